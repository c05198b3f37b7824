// Finds the nearest eye that has a set of points in a part of the picture.

import * as THREE from "three";
import type { Viewpoint } from "./stage.ts";

/** Between the points and the edges of the picture: half of a name may stand there. */
const EDGE_PX = 28;
/** A low picture keeps this fraction of its height for the points between the tools and the notes. */
const LEAST_HEIGHT = 0.6;
/** The size of a picture of one object or room beside its own size, and its least size. */
const SURROUNDINGS = 1.3;
const LEAST_M = 1.2;

/** The part of the picture for the points: -1 to 1 from left to right and from bottom to top. */
interface Part {
  left: number;
  right: number;
  bottom: number;
  top: number;
}

/** Returns the part of a picture that neither the tools at its top nor the notes at its bottom cover. */
export function freePart(width_px: number, height_px: number, tools_px: number, notes_px = 0): Part {
  const [x, y] = [Math.max(0.2, 1 - (2 * EDGE_PX) / width_px), Math.max(0.2, 1 - (2 * EDGE_PX) / height_px)];
  const top = Math.max(-y + 2 * LEAST_HEIGHT, y - (2 * tools_px) / height_px);
  const bottom = Math.min(top - 2 * LEAST_HEIGHT, -y + (2 * notes_px) / height_px);
  return { left: -x, right: x, bottom, top };
}

/** Returns the points of an object or a room, farther apart: a person sees the things around it. */
export function withSurroundings(points: readonly THREE.Vector3[]): THREE.Vector3[] {
  const box = new THREE.Box3().setFromPoints([...points]);
  const [middle, size] = [box.getCenter(new THREE.Vector3()), box.getSize(new THREE.Vector3())];
  const factor = Math.max(SURROUNDINGS, LEAST_M / Math.max(size.x, size.y, size.z, 0.01));
  return points.map((point) => point.clone().sub(middle).multiplyScalar(factor).add(middle));
}

export function cornersOf({ min, max }: THREE.Box3): THREE.Vector3[] {
  return [min.x, max.x].flatMap((x) => [min.y, max.y].flatMap((y) => [min.z, max.z].map((z) => new THREE.Vector3(x, y, z))));
}

/**
 * Returns the nearest viewpoint in the direction `towardsEye` that has all points in the part. `lens` is the tangent of half
 * the angle of view, across and up.
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

/** Returns the least depth of an eye along one axis of the picture, and its place on this axis at a depth. */
function span(places: number[], depths: number[], low: number, high: number) {
  const from = Math.max(...places.map((place, i) => place + high * (depths[i] ?? 0)));
  const to = Math.min(...places.map((place, i) => place + low * (depths[i] ?? 0)));
  return {
    least: (from - to) / (high - low),
    middleAt: (depth: number) => (from - high * depth + to - low * depth) / 2,
  };
}
