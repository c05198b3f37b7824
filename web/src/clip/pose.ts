// The pose of a clip that is in force, and the alternative of its answer that has it.

import type { Clip, Pose2 } from "../types.ts";
import { isOfEarlierMap } from "./last.ts";

/** An alternative is the pose in force if both differ by less than this. */
const SAME_M = 0.3;
const SAME_RAD = (20 * Math.PI) / 180;

interface Posed {
  level: string;
  map_from_clip: Pose2;
}

/** The pose that a person chose, else that of the home's map, else that of the clip's own answer. */
export function poseInForce({ choice, placement, alignment, state }: Clip): Posed | null {
  if (choice) return choice;
  // After a choice is withdrawn, the map keeps its pose until the next merge.
  if (placement && placement.by !== "person") return placement;
  if (state !== "aligned" || !alignment?.map_from_clip) return null;
  return { level: alignment.level, map_from_clip: alignment.map_from_clip };
}

/**
 * The index of the alternative whose pose is in force; null without one. The index of a choice does not tell it: a later
 * job may have another order.
 */
export function chosenOf(clip: Clip): number | null {
  const pose = poseInForce(clip);
  // A choice moves to the new LiDAR map at once, the last answer stays in the frame of the previous one.
  if (!pose || (clip.choice && isOfEarlierMap(clip))) return null;
  const near = (clip.alignment?.alternatives ?? []).flatMap((one, index) => {
    const distance_m = distance(one.map_from_clip, pose.map_from_clip);
    const turn_rad = Math.abs(turn(one.map_from_clip.yaw_rad - pose.map_from_clip.yaw_rad));
    return one.level === pose.level && distance_m < SAME_M && turn_rad < SAME_RAD ? [{ index, distance_m }] : [];
  });
  return near.sort((a, b) => a.distance_m - b.distance_m)[0]?.index ?? null;
}

function distance(a: Pose2, b: Pose2): number {
  return Math.hypot(a.x_m - b.x_m, a.y_m - b.y_m);
}

/** An angle in [-pi, pi]. */
function turn(angle_rad: number): number {
  return Math.atan2(Math.sin(angle_rad), Math.cos(angle_rad));
}
