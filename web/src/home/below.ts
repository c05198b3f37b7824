// The LiDAR map below the home's map. After a new LiDAR map the home's map stays in the frame of the previous one until it is rebuilt.

import type { HomeData } from "./data.ts";

/** Frames that differ by less than this count as one. */
const SAME_M = 0.1;
const SAME_RAD = 0.01;

type Known = Pick<HomeData, "map" | "lidar" | "level">;

/** The revision of the LiDAR map in whose frame the shown level of the home's map is; null if the level has no points. */
function frameOf({ map, level }: Known): number | null {
  const shown = map?.levels.find((one) => one.level === level);
  return shown && shown.info.points > 0 ? shown.lidar_map_revision : null;
}

/** True if the home's map is of an earlier LiDAR map than the current one. */
export function isOfPreviousLidar(data: Known): boolean {
  const frame = frameOf(data);
  return frame !== null && data.lidar !== null && frame !== data.lidar.revision;
}

/** The LiDAR map of the shown level; null if it has another frame than the home's map: its walls would lie elsewhere. */
export function lidarBelow(data: Known): Known["lidar"] {
  const { lidar } = data;
  if (!lidar || !isOfPreviousLidar(data)) return lidar;
  const { from_earlier: from } = lidar;
  if (from?.revision !== frameOf(data)) return null;
  const { x_m, y_m, yaw_rad } = from.map_from_earlier;
  return Math.hypot(x_m, y_m) < SAME_M && Math.abs(yaw_rad) < SAME_RAD ? lidar : null;
}
