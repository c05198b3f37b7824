// Finds the point of the cloud, or the box, under a pixel.

import { corners } from "../frames.ts";
import type { Thing } from "../types.ts";

export type Point3 = [number, number, number];

export interface Ray {
  origin: Point3;
  /** Of length 1. */
  direction: Point3;
}

export function along({ origin, direction }: Ray, distance_m: number): Point3 {
  return [
    origin[0] + distance_m * direction[0], origin[1] + distance_m * direction[1], origin[2] + distance_m * direction[2],
  ];
}

/**
 * Returns the distance to the nearest point whose direction differs by less than `reach_rad` from the ray's, and null
 * if there is none. Points that `isShown` refuses are passed through, and
 * only every `stride`-th point is looked at.
 */
export function pointOn(
  ray: Ray,
  positions: Float32Array,
  count: number,
  reach_rad: number,
  isShown: (index: number) => boolean,
  stride = 1,
): number | null {
  const [[ox, oy, oz], [dx, dy, dz]] = [ray.origin, ray.direction];
  const reach = reach_rad * reach_rad;
  let best = Infinity;
  for (let i = 0; i < count; i += stride) {
    const x = (positions[3 * i] ?? 0) - ox;
    const y = (positions[3 * i + 1] ?? 0) - oy;
    const z = (positions[3 * i + 2] ?? 0) - oz;
    const depth = x * dx + y * dy + z * dz;
    if (depth <= 0.05 || depth >= best) continue;
    if (x * x + y * y + z * z - depth * depth < reach * depth * depth && isShown(i)) best = depth;
  }
  return best === Infinity ? null : best;
}

/** Returns the distances at which a ray enters and leaves an object's box; null if it misses it. */
export function throughBox({ origin, direction }: Ray, thing: Thing, margin_m = 0): [number, number] | null {
  const [cos, sin] = [Math.cos(thing.yaw_rad), Math.sin(thing.yaw_rad)];
  const offset = origin.map((value, axis) => value - (thing.centre_m[axis] ?? 0));
  const turned = ([x = 0, y = 0, z = 0]: readonly number[]) => [cos * x + sin * y, cos * y - sin * x, z];
  const [start, way] = [turned(offset), turned(direction)];
  let [enter, leave] = [-Infinity, Infinity];
  for (let axis = 0; axis < 3; axis++) {
    const half = (thing.size_m[axis] ?? 0) / 2 + margin_m;
    const [from, step] = [start[axis] ?? 0, way[axis] ?? 0];
    if (Math.abs(step) < 1e-9) {
      if (Math.abs(from) > half) return null;
      continue;
    }
    const [a, b] = [(-half - from) / step, (half - from) / step];
    enter = Math.max(enter, Math.min(a, b));
    leave = Math.min(leave, Math.max(a, b));
  }
  return leave >= Math.max(enter, 0) ? [enter, leave] : null;
}

/**
 * Returns the object under a pixel. With a surface in sight it is the smallest box around that surface; without one,
 * the nearest box.
 */
export function thingOn(ray: Ray, things: readonly Thing[], surface_m: number | null): Thing | null {
  const volume = ({ size_m: [x, y, z] }: Thing) => x * y * z;
  let best: Thing | null = null;
  let least = Infinity;
  for (const thing of things) {
    const through = throughBox(ray, thing, 0.05);
    if (!through) continue;
    const [enter, leave] = through;
    const isAtSurface = surface_m !== null && surface_m >= enter && surface_m <= leave;
    if (surface_m !== null && !isAtSurface) continue;
    const rank = isAtSurface ? volume(thing) : enter;
    if (rank < least) [best, least] = [thing, rank];
  }
  return best;
}

/** Returns the object above a point of the floor, the smallest one where several are. */
export function thingAbove([x, y]: readonly [number, number], things: readonly Thing[]): Thing | null {
  const high = Math.max(10, ...things.map(({ centre_m, size_m }) => centre_m[2] + size_m[2]));
  const down: Ray = { origin: [x, y, high], direction: [0, 0, -1] };
  const hit = things.filter((thing) => throughBox(down, thing));
  const area = ({ size_m: [length, width] }: Thing) => length * width;
  return hit.reduce<Thing | null>((best, thing) => (best && area(best) <= area(thing) ? best : thing), null);
}

/** The part of an object below a height, as a box; null if all of it is higher. */
export function partBelow(thing: Thing, height_m: number): Thing | null {
  const [[x, y, z], [length, width, height]] = [thing.centre_m, thing.size_m];
  const [low_m, high_m] = [z - height / 2, z + height / 2];
  if (low_m >= height_m) return null;
  if (high_m <= height_m) return thing;
  return { ...thing, centre_m: [x, y, (low_m + height_m) / 2], size_m: [length, width, height_m - low_m] };
}

/** The corners of a box in space. */
export function hullOf(thing: Thing): Point3[] {
  const [z, half] = [thing.centre_m[2], thing.size_m[2] / 2];
  return corners(thing.centre_m, thing.size_m, thing.yaw_rad).flatMap(([x, y]): Point3[] => [[x, y, z - half], [x, y, z + half]]);
}
