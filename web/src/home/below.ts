// The LiDAR map below the home's map. After a new LiDAR map the home's map stays in the frame of the previous one until it is rebuilt.

import { around, type Box2, inverse, place, type Point2 } from "../frames.ts";
import type { Pose2 } from "../types.ts";
import type { HomeData } from "./data.ts";

const SAME_FRAME: Pose2 = { x_m: 0, y_m: 0, yaw_rad: 0 };

type Known = Pick<HomeData, "map" | "lidar" | "level">;

/** A LiDAR map, and the pose of its frame in that of the home's map. */
export interface Below {
  lidar: NonNullable<Known["lidar"]>;
  at: Pose2;
}

/** The revision of the LiDAR map in whose frame the shown level of the home's map is; null if the level has no points. */
export function frameOf({ map, level }: Known): number | null {
  const shown = map?.levels.find((one) => one.level === level);
  return shown && shown.info.points > 0 ? shown.lidar_map_revision : null;
}

/** True if the home's map is of an earlier LiDAR map than the current one. */
export function isOfPreviousLidar(data: Known): boolean {
  const frame = data.lidar && frameOf(data);
  return frame !== null && frame !== data.lidar?.revision;
}

/** The LiDAR map of the shown level; null if its frame beside that of the home's map is not known: its walls would lie elsewhere. */
export function lidarBelow(data: Known): Below | null {
  const { lidar } = data;
  if (!lidar) return null;
  if (!isOfPreviousLidar(data)) return { lidar, at: SAME_FRAME };
  const { from_earlier: from } = lidar;
  return from?.revision === frameOf(data) ? { lidar, at: inverse(from.map_from_earlier) } : null;
}

/** The box of the LiDAR map in the frame of the home's map. */
export function boxBelow({ lidar: { info: { min_m: [left, low], max_m: [right, high] } }, at }: Below): Box2 | null {
  const ends: Point2[] = [[left, low], [right, low], [right, high], [left, high]];
  return around(ends.map((end) => place(at, end)));
}
