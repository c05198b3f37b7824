// Shapes between the points: the LiDAR map on the floor, camera paths, boxes around objects.

import * as THREE from "three";
import { corners, place } from "../frames.ts";
import type { PictureFrame, Pose2, Thing } from "../types.ts";
import type { Rgb } from "./colours.ts";

/** Below the floor's own points, so that they do not flicker. */
const FLOOR_Z_M = -0.04;

/** A picture of the floor, its place in its own frame, and the pose of that frame. */
export interface FloorPicture {
  canvas: HTMLCanvasElement;
  frame: PictureFrame;
  at: Pose2;
}

export function floorOf({ canvas, frame, at }: FloorPicture): THREE.Mesh {
  const [width, height] = [frame.width_px / frame.px_per_m, frame.height_px / frame.px_per_m];
  const texture = new THREE.CanvasTexture(canvas);
  texture.colorSpace = THREE.SRGBColorSpace;
  texture.anisotropy = 4;
  const material = new THREE.MeshBasicMaterial({
    map: texture, transparent: true, depthWrite: false, side: THREE.DoubleSide,
  });
  const mesh = new THREE.Mesh(new THREE.PlaneGeometry(width, height), material);
  const [x, y] = place(at, [frame.corner_m[0] + width / 2, frame.corner_m[1] - height / 2]);
  mesh.position.set(x, y, FLOOR_Z_M);
  mesh.rotation.z = at.yaw_rad;
  mesh.renderOrder = -1;
  return mesh;
}

/** A colour of the screen. */
export function colorOf([red, green, blue]: Rgb): THREE.Color {
  return new THREE.Color().setRGB(red / 255, green / 255, blue / 255, THREE.SRGBColorSpace);
}

/** A material so thin that what is in it or on it shows through. */
function veil(colour: Rgb, opacity: number): THREE.MeshBasicMaterial {
  return new THREE.MeshBasicMaterial({
    color: colorOf(colour), transparent: true, opacity, depthTest: false, depthWrite: false, side: THREE.DoubleSide,
  });
}

function lines(places: number[], colour: Rgb, depthTest: boolean, clippingPlanes: THREE.Plane[] = []): THREE.LineSegments {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.Float32BufferAttribute(places, 3));
  return new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: colorOf(colour), depthTest, clippingPlanes }));
}

/** A camera's way, seen through walls too, with a cross where it began and a plumb line to the floor. */
export function pathOf(places_m: [number, number, number][], colour: Rgb): THREE.LineSegments {
  const segments: number[] = [];
  for (let i = 1; i < places_m.length; i++) segments.push(...(places_m[i - 1] ?? []), ...(places_m[i] ?? []));
  const [first] = places_m;
  if (first) {
    const [x, y, z] = first;
    for (const [u, v] of [[0.12, 0], [-0.12, 0], [0, 0.12], [0, -0.12]] as const) {
      segments.push(x, y, z, x + u, y + v, z);
    }
    segments.push(x, y, z, x, y, 0);
  }
  return lines(segments, colour, false);
}

/** The twelve edges of an object's box, within planes. */
export function boxOf(thing: Thing, colour: Rgb, planes: THREE.Plane[] = []): THREE.LineSegments {
  const base = corners(thing.centre_m, thing.size_m, thing.yaw_rad);
  const [low, high] = [thing.centre_m[2] - thing.size_m[2] / 2, thing.centre_m[2] + thing.size_m[2] / 2];
  const segments: number[] = [];
  base.forEach(([x, y], i) => {
    const [u, v] = base[(i + 1) % 4] ?? [x, y];
    segments.push(x, y, low, u, v, low, x, y, high, u, v, high, x, y, low, x, y, high);
  });
  return lines(segments, colour, true, planes);
}

/** A box's faces. */
export function solidOf(thing: Thing, colour: Rgb): THREE.Mesh {
  const mesh = new THREE.Mesh(new THREE.BoxGeometry(...thing.size_m), veil(colour, 0.18));
  mesh.position.set(...thing.centre_m);
  mesh.rotation.z = thing.yaw_rad;
  return mesh;
}

/** A ring on the floor. */
export function outlineOf(ring_m: readonly [number, number][], colour: Rgb): THREE.LineSegments {
  const segments = ring_m.flatMap(([x, y], i) => {
    const [u, v] = ring_m[(i + 1) % ring_m.length] ?? [x, y];
    return [x, y, 0.03, u, v, 0.03];
  });
  return lines(segments, colour, false);
}

/** The area within a ring. */
export function patchOf(ring_m: readonly [number, number][], colour: Rgb): THREE.Mesh {
  const shape = new THREE.Shape(ring_m.map(([x, y]) => new THREE.Vector2(x, y)));
  return new THREE.Mesh(new THREE.ShapeGeometry(shape), veil(colour, 0.22));
}

/** Gives back what the graphics card holds for everything below. */
export function release(group: THREE.Object3D): void {
  group.traverse((object) => {
    if (!(object instanceof THREE.Mesh || object instanceof THREE.LineSegments || object instanceof THREE.Points)) return;
    object.geometry.dispose();
    const material = object.material as THREE.MeshBasicMaterial;
    material.map?.dispose();
    material.dispose();
  });
  group.clear();
}
