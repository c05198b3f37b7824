// Advice about a clip that has no certain place: the next step, by the reasons of the service.

import type { Clip } from "../types.ts";
import { isForeign } from "./alternatives.ts";

const FILM_AGAIN = "Film again: slowly, for at least half a minute, with walls, corners and the floor in sight.";
const NOT_THE_CLIP = "The clip is not at fault. Align it again later.";
const SLOWER = "Film again and move more slowly.";

/** By the code of a reason; earlier rows go first. */
const ADVICE: Record<string, string> = {
  no_lidar_map: "Put the LiDAR map of the robot.",
  map_empty: "The LiDAR map has no walls. Let the robot map the home again, and put the new map.",
  no_support: "Probably not this home, or a part of it that the robot has not mapped. If it is this home, put a newer " +
    "LiDAR map; if not, delete the clip.",
  several_modes: "Film more of the walls and corners of this room, or choose its place on the page of the clip.",
  weak_evidence: "Film more of the walls, and their lower half.",
  too_few_hits: "Film more of the walls: step back, and hold the phone so that the floor is in sight too.",
  no_floor: "Film again with the floor in sight.",
  up_unknown: "Film again with the floor in sight, and hold the phone upright.",
  nothing_fused: "The depth sensor saw no surface. Stay between half a metre and four metres from walls and furniture.",
  no_posed_frame: "Record with an app that stores the poses of the phone.",
  track_dark: "Switch on the light and film again.",
  track_jump: SLOWER,
  track_no_depth: "Stay between half a metre and four metres from walls and furniture.",
  track_unconstrained: "Keep furniture or corners in sight; a blank wall alone is not enough.",
  track_failed: SLOWER,
  clip_extent_too_large: "Send the recording in parts, one for each room.",
  clip_too_large: "Send the recording in parts, one for each room.",
  storage_fault: NOT_THE_CLIP,
  system_fault: NOT_THE_CLIP,
  worker_lost: NOT_THE_CLIP,
  internal_error: NOT_THE_CLIP,
  cancelled: "Align it again.",
  worker_died: "The recording may be too large for this machine. Send it in parts.",
  too_large: "Send the recording in parts, one for each room.",
  took_too_long: "Send the recording in parts, one for each room.",
};

const FOREIGN = "Probably not this home, or a part of it that the robot has not mapped. Put a newer LiDAR map, or film " +
  "again with more walls and floor in sight.";

/** Advice about a choice that another LiDAR map may have made wrong. */
const ADVICE_ON_CHOICE: Record<string, string> = {
  choice_of_earlier_lidar_map: "Check its place in the LiDAR map. Choose it again, or withdraw the choice.",
  choice_carried_over: "Check its place once: it moved with the LiDAR map.",
};

/** The next steps of a person; empty if the clip has its place, or will have. */
export function adviceOf(clip: Clip): string[] {
  if (clip.choice) return clip.reasons.flatMap(({ code }) => ADVICE_ON_CHOICE[code] ?? []);
  if (clip.placement || !["ambiguous", "failed", "uploaded"].includes(clip.state)) return [];
  const codes = new Set(clip.reasons.map(({ code }) => code));
  const known = Object.entries(ADVICE).filter(([code]) => codes.has(code)).map(([, advice]) => advice);
  const list = isForeign(clip) && !codes.has("no_support") ? [FOREIGN] : known;
  if (list.length > 0) return [...new Set(list)].slice(0, 2);
  return clip.state === "failed" ? [FILM_AGAIN] : [];
}
