// Tells whether a clip may be of another home, and whether a place is probable enough to be offered.

import type { Alternative, Clip } from "../types.ts";

/** A less probable place is not offered as the obvious choice, and choosing it asks again. */
const PLAUSIBLE = 0.2;

/** A clip whose best place is less probable than the first, or all together less than the second, has no obvious place. */
const OBVIOUS = 0.5;
const COMPLETE = 0.7;

/** Codes of wrong units or conventions in the files: until they are corrected, no place is right. */
export const OF_FILES = ["poses_disagree", "scale_disagrees"];

/** True if units or conventions in the files of the clip are wrong. */
export function hasWrongFiles({ reasons }: Clip): boolean {
  return reasons.some(({ code }) => OF_FILES.includes(code));
}

/** True if the map has a place of the clip. An unclear clip may still have one of an earlier map, until the next map is made. */
export function isPlaced({ state, placement }: Clip): boolean {
  return state === "aligned" || placement?.by === "neighbours";
}

/** True if the clip is probably of another home by its answer. */
export function isForeign(clip: Clip): boolean {
  return !clip.choice && !isPlaced(clip) && clip.reasons.some(({ code }) => code === "not_this_home");
}

/** True if no place stands out: eight places that are equally probable may all be wrong, and the clip of another home. */
export function mayBeForeign(clip: Clip): boolean {
  const places = clip.alignment?.alternatives ?? [];
  if (clip.state !== "ambiguous" || clip.choice || isPlaced(clip) || isForeign(clip)) return false;
  return places.length > 0 && !places.some(isProbable);
}

/** True if the place is so improbable, or the clip so doubtful, that a person should look twice before it is chosen. */
export function isDoubtful(clip: Clip, one: Alternative): boolean {
  return clip.state === "failed" || isForeign(clip) || hasWrongFiles(clip) || !isProbable(one) || !hasObviousPlace(clip);
}

/** The probability that none of the places of the clip is right; null if the method gives no probabilities. */
export function noneIsRight({ alignment }: Clip): number | null {
  const places = alignment?.alternatives ?? [];
  if (places.length === 0 || places.some(({ probability }) => probability === null)) return null;
  return Math.max(0, 1 - places.reduce((sum, { probability }) => sum + (probability ?? 0), 0));
}

/** True if the places of the clip leave much probability to another home, or to a part of it that the map does not have. */
export function mayLieElsewhere(clip: Clip): boolean {
  return clip.state === "failed" || isForeign(clip) || 1 - (noneIsRight(clip) ?? 0) < COMPLETE;
}

function hasObviousPlace(clip: Clip): boolean {
  const best = Math.max(0, ...(clip.alignment?.alternatives ?? []).map(({ probability }) => probability ?? 1));
  return best >= OBVIOUS && !mayLieElsewhere(clip);
}

/** A method that gives no probabilities says nothing against a place. */
function isProbable({ probability }: Alternative): boolean {
  return (probability ?? 1) >= PLAUSIBLE;
}
