// The map's frame is x right, y up, in metres; a clip's frame has its own origin and direction.

import type { Pose2 } from "./types.ts";

export type Point2 = [number, number];

/** A point of the clip's frame in the map's. */
export function place(mapFromClip: Pose2, [x, y]: readonly [number, number]): Point2 {
  const [sin, cos] = [Math.sin(mapFromClip.yaw_rad), Math.cos(mapFromClip.yaw_rad)];
  return [mapFromClip.x_m + cos * x - sin * y, mapFromClip.y_m + sin * x + cos * y];
}

/** The pose that takes a point back: of map from clip, that of clip from map. */
export function inverse({ x_m, y_m, yaw_rad }: Pose2): Pose2 {
  const [x, y] = place({ x_m: 0, y_m: 0, yaw_rad: -yaw_rad }, [x_m, y_m]);
  return { x_m: -x, y_m: -y, yaw_rad: -yaw_rad };
}

/** One pose after another: of map from clip and clip from camera, that of map from camera. */
export function composed(a: Pose2, b: Pose2): Pose2 {
  const [x_m, y_m] = place(a, [b.x_m, b.y_m]);
  return { x_m, y_m, yaw_rad: a.yaw_rad + b.yaw_rad };
}

/** The corners of a box on the floor, counter-clockwise. */
export function corners(centre: readonly number[], size: readonly number[], yaw_rad: number): Point2[] {
  const [x_m = 0, y_m = 0] = centre;
  const [length = 0, width = 0] = size;
  const signs: Point2[] = [[-1, -1], [1, -1], [1, 1], [-1, 1]];
  return signs.map(([u, v]) => place({ x_m, y_m, yaw_rad }, [(u * length) / 2, (v * width) / 2]));
}

/** True if a point lies in a ring of corners. */
export function isInside(ring: readonly Point2[], [x, y]: Point2): boolean {
  let isIn = false;
  ring.forEach(([x1, y1], i) => {
    const [x2, y2] = ring[(i + 1) % ring.length] ?? [x1, y1];
    if (y1 > y !== y2 > y && x < x1 + ((y - y1) / (y2 - y1)) * (x2 - x1)) isIn = !isIn;
  });
  return isIn;
}

export interface Box2 {
  min: Point2;
  max: Point2;
}

/** The smallest box around points; null without any. */
export function around(points: Iterable<readonly [number, number]>): Box2 | null {
  let box: Box2 | null = null;
  for (const [x, y] of points) {
    if (!Number.isFinite(x) || !Number.isFinite(y)) continue;
    box ??= { min: [x, y], max: [x, y] };
    box.min = [Math.min(box.min[0], x), Math.min(box.min[1], y)];
    box.max = [Math.max(box.max[0], x), Math.max(box.max[1], y)];
  }
  return box;
}
