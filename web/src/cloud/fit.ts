// Finds the nearest eye that has a set of points in a part of the picture.

import * as THREE from "three";
import type { Viewpoint } from "./stage.ts";

/** The part of the picture for the points: -1 to 1 from left to right and from bottom to top. */
export interface Part {
  left: number;
  right: number;
  bottom: number;
  top: number;
}

/**
 * The viewpoint in the direction `towardsEye` from the points; the nearest one that has all of them in the part. `lens` is the
 * tangent of half the angle of view, across and up.
 */
export function fitted(points: readonly THREE.Vector3[], towardsEye: THREE.Vector3, lens: [number, number], part: Part): Viewpoint {
  const back = towardsEye.clone().normalize();
  const right = new THREE.Vector3(0, 0, 1).cross(back).normalize();
  const up = back.clone().cross(right);
  const depths = points.map((point) => point.dot(back));
  // A point is in the part if its offset from the eye is at most its depth times the tangent of the part's edge. So each edge
  // bounds the eye's place by a line in the eye's depth, and two opposite lines cross at the least depth.
  const across = span(points.map((point) => point.dot(right)), depths, part.left * lens[0], part.right * lens[0]);
  const upward = span(points.map((point) => point.dot(up)), depths, part.bottom * lens[1], part.top * lens[1]);
  const depth = Math.max(across.least, upward.least);
  const onAxis = new THREE.Vector3().addScaledVector(right, across.middleAt(depth)).addScaledVector(up, upward.middleAt(depth));
  const middle = (Math.min(...depths) + Math.max(...depths)) / 2;
  const at = (depth: number) => onAxis.clone().addScaledVector(back, depth).toArray();
  return { eye_m: at(depth), target_m: at(middle) };
}

/** The least depth of an eye along one axis of the picture, and its place on this axis at a depth. */
function span(places: number[], depths: number[], low: number, high: number) {
  const from = Math.max(...places.map((place, i) => place + high * (depths[i] ?? 0)));
  const to = Math.min(...places.map((place, i) => place + low * (depths[i] ?? 0)));
  return {
    least: (from - to) / (high - low),
    middleAt: (depth: number) => (from - high * depth + to - low * depth) / 2,
  };
}
