// Advice about a clip that has no certain place: the next step, by the reasons of the service.

import type { Clip } from "../types.ts";
import { isForeign, isPlaced, mayBeForeign, OF_FILES } from "./plausible.ts";

const FILM_AGAIN = "Film again: slowly, for at least half a minute, with walls, corners and the floor in sight.";
const DAMAGED = "The file is damaged or incomplete. Export the recording again, and send it.";
const NOT_THE_CLIP = "The clip is not at fault. Press “Find its place again” later.";
const SLOWER = "Film again and move more slowly.";
const CLOSER = "Stay between 0.5 and 4 m from walls and furniture (depth from 0.15 to 5 m is used).";
const SEVERAL_CLIPS = "Split the recording into several clips, one for each room.";
const MORE_OF_ROOM = "Film more of the walls and corners of this room, or choose one of the clip's places.";

/** Advice by the code of a reason; earlier rows come first. tests/house/reasons.rs compares them with docs/api.md. */
const ADVICE: Record<string, string> = {
  no_lidar_map: "Upload the LiDAR map.",
  map_empty: "The LiDAR map has no walls. Let the robot map the home again, and upload the new map.",
  no_support: "Probably not this home, or a part of it that the robot has not mapped. If it is this home, upload a " +
    "newer LiDAR map; if not, delete the clip.",
  no_candidate: "Check that the LiDAR map is of this home.",
  several_modes: MORE_OF_ROOM,
  search_incomplete: MORE_OF_ROOM,
  several_scales: "Film more of the room, or record with a phone that measures depth.",
  scale_disagrees: "Check the unit of the clip's depth and the size of the map's cells: one of them seems to be wrong. Send the " +
    "corrected file. If both are right, film more of the room.",
  weak_evidence: "Film more of the walls, and their lower half.",
  too_few_hits: "Film more of the walls: step back, and hold the phone so that the floor is in sight too.",
  no_floor: "Film again with the floor in sight.",
  up_unknown: "Film again with the floor in sight, and hold the phone upright.",
  scale_unknown: "Film again with some floor in sight, or record with a phone that measures depth.",
  nothing_fused: `The depth sensor saw no surface. ${CLOSER}`,
  no_posed_frame: "Record with an app that stores the path of the phone.",
  no_frame_in_range: "Let its place be found again, with frames that it has.",
  sparse_frames: "Record at 10 frames a second or more.",
  poses_disagree: "Correct the camera poses, and send the clip again: they must be world from camera, in metres, with x right, y down " +
    "and z forward. If an app made the file, record with another app.",
  poses_dropped: "Check that the poses of the recording are in metres.",
  track_dark: "Switch on the light and film again.",
  track_jump: SLOWER,
  track_no_depth: CLOSER,
  track_unconstrained: "Keep furniture or corners in sight; a blank wall alone is not enough.",
  track_failed: SLOWER,
  clip_extent_too_large: SEVERAL_CLIPS,
  clip_too_large: SEVERAL_CLIPS,
  unreadable: "Send the file again.",
  storage_fault: NOT_THE_CLIP,
  system_fault: NOT_THE_CLIP,
  worker_lost: NOT_THE_CLIP,
  storage_error: NOT_THE_CLIP,
  internal_error: NOT_THE_CLIP,
  cancelled: "Press “Find its place again”.",
  superseded: "Nothing is to be done: the clip is being placed again.",
  worker_died: "The recording may be too large for this machine. Split it into several clips.",
  too_large: SEVERAL_CLIPS,
  took_too_long: SEVERAL_CLIPS,
};

const MAY_BE_FOREIGN = "It may be of another home: no place stands out. If you recognise none of them, choose none: film again with " +
  "more walls and corners, or delete the clip.";
const FOREIGN = "Probably not this home, or a part of it that the robot has not mapped. Upload a newer LiDAR map, or " +
  "film again with more walls and floor in sight.";

/** Codes of faults of the filming. Their advice comes first if no place stands out: a better clip may have a certain place. */
const OF_FILMING = [
  "no_floor", "up_unknown", "sparse_frames", "track_dark", "track_jump", "track_no_depth", "track_unconstrained", "track_failed",
];

/** Advice about a choice that another LiDAR map may have made wrong. */
const ADVICE_ON_CHOICE: Record<string, string> = {
  choice_of_earlier_lidar_map: "Check its place in the LiDAR map. Choose it again, or withdraw the choice.",
  choice_carried_over: "Check its place once: it moved with the LiDAR map.",
  choice_without_result: "Press “Find its place again”; the choice then holds.",
};

/** The advice for a reason; null if the page has none. */
export function adviceFor(code: string): string | null {
  return ADVICE[code] ?? ADVICE_ON_CHOICE[code] ?? (code === "not_this_home" ? FOREIGN : null);
}

/** The next steps of a person; empty if the clip has its place, or will have. */
export function adviceOf(clip: Clip): string[] {
  if (clip.choice) return clip.reasons.flatMap(({ code }) => ADVICE_ON_CHOICE[code] ?? []);
  if (isPlaced(clip) || !["ambiguous", "failed", "uploaded"].includes(clip.state)) return [];
  const codes = new Set<string>(clip.reasons.map(({ code }) => code));
  const of = (wanted: string[]) => wanted.filter((code) => codes.has(code)).flatMap((code) => ADVICE[code] ?? []);
  const ofFiles = of(OF_FILES);
  // No place of such a clip is right, and it does not matter whether it is of this home.
  if (codes.has("poses_disagree")) return ofFiles;
  // A clip of another home may fit better at another scale by chance.
  if (ofFiles.length > 0 && isForeign(clip)) return [...ofFiles, FOREIGN];
  if (mayBeForeign(clip)) return [...[...ofFiles, ...of(OF_FILMING)].slice(0, 1), MAY_BE_FOREIGN];
  if (ofFiles.length > 0) return ofFiles;
  const list = isForeign(clip) && !codes.has("no_support") ? [FOREIGN] : of(Object.keys(ADVICE));
  if (list.length > 0) return [...new Set(list)].slice(0, 2);
  if (clip.state !== "failed") return [];
  // The other codes are those of the readers of files, which end before there is an answer.
  return [clip.alignment || codes.size === 0 ? FILM_AGAIN : DAMAGED];
}

/** The advice about the first reason of a clip, for a list without the buttons of its page; null if the clip needs none. */
export function adviceOn(clip: Clip, code: string | undefined): string | null {
  return firstAdvice(clip, code)?.replace("“Find its place again”", "“Find its place again” on its page") ?? null;
}

function firstAdvice(clip: Clip, code: string | undefined): string | null {
  const list = adviceOf(clip);
  if (list.length === 0) return null;
  const own = adviceFor(code ?? "");
  if (own && list.includes(own)) return own;
  const ofOthers = new Set(clip.reasons.map((reason) => adviceFor(reason.code)));
  return list.find((text) => !ofOthers.has(text)) ?? own;
}
