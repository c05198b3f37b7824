// Tells whether a clip may be of another home, and whether a place is probable enough to be offered.

import type { Alternative, Clip } from "../types.ts";

/** A less probable place is not offered as the obvious choice, and choosing it asks again. */
const PLAUSIBLE = 0.2;

/** Codes of wrong units or conventions in the files: until they are corrected, no place is right. */
export const OF_FILES = ["poses_disagree", "scale_disagrees"];

/** True if units or conventions in the files of the clip are wrong. */
export function hasWrongFiles({ reasons }: Clip): boolean {
  return reasons.some(({ code }) => OF_FILES.includes(code));
}

/** True if the clip is probably of another home by its answer. */
export function isForeign(clip: Clip): boolean {
  return !clip.choice && !clip.placement && clip.reasons.some(({ code }) => code === "not_this_home");
}

/** True if no place stands out: eight places that are equally probable may all be wrong, and the clip of another home. */
export function mayBeForeign(clip: Clip): boolean {
  const places = clip.alignment?.alternatives ?? [];
  if (clip.state !== "ambiguous" || clip.choice || clip.placement || isForeign(clip)) return false;
  return places.length > 0 && !places.some(isProbable);
}

/** True if the place is so improbable, or the clip so doubtful, that a person should look twice before it is chosen. */
export function isDoubtful(clip: Clip, one: Alternative): boolean {
  return clip.state === "failed" || isForeign(clip) || hasWrongFiles(clip) || !isProbable(one);
}

/** A method that gives no probabilities says nothing against a place. */
function isProbable({ probability }: Alternative): boolean {
  return (probability ?? 1) >= PLAUSIBLE;
}
