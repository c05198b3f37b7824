// Points from above as a picture: in each of its pixels the highest point that is shown.

import { RAMP, type Colouring, type Rgb } from "../cloud/colours.ts";
import type { Points } from "../cloud/ply.ts";
import type { Box2 } from "../frames.ts";
import type { PictureFrame } from "../types.ts";

const MAX_SIDE_PX = 1600;

export interface Shown {
  colouring: Colouring;
  cut_m: number;
  /** Colours by class id and by clip index; points without a colour are hidden. */
  classes: Map<number, Rgb>;
  clips: Map<number, Rgb>;
}

export function ramped(share: number): Rgb {
  const place = Math.min(1, Math.max(0, share)) * (RAMP.length - 1);
  const low = Math.min(Math.floor(place), RAMP.length - 2);
  const [from, to] = [RAMP[low] ?? [0, 0, 0], RAMP[low + 1] ?? [0, 0, 0]];
  return from.map((value, i) => Math.round(value + ((to[i] ?? 0) - value) * (place - low))) as Rgb;
}

/** Pixels are a little wider than voxels, so that surfaces close. */
const VOXELS_PER_PX = 1.5;

/** The place and the size of a picture of the box. */
export function frameOf({ min, max }: Box2, voxel_m: number): PictureFrame {
  const size = Math.max(max[0] - min[0], max[1] - min[1], voxel_m) + voxel_m;
  const px_per_m = Math.min(1 / (VOXELS_PER_PX * voxel_m), MAX_SIDE_PX / size);
  const side = (from: number, to: number) => Math.max(1, Math.ceil((to - from + voxel_m) * px_per_m));
  return {
    corner_m: [min[0] - voxel_m / 2, max[1] + voxel_m / 2],
    px_per_m,
    width_px: side(min[0], max[0]),
    height_px: side(min[1], max[1]),
  };
}

/** The first `count` points from above. */
export function fromAbove(
  points: Points,
  count: number,
  frame: PictureFrame,
  shown: Shown,
): Uint8ClampedArray<ArrayBuffer> {
  const { width_px: width, height_px: height, px_per_m, corner_m } = frame;
  const pixels = new Uint8ClampedArray(width * height * 4);
  const tops = new Float32Array(width * height).fill(-Infinity);
  const { position, tint, kind } = points;
  for (let i = 0; i < count; i++) {
    const z = position[3 * i + 2] ?? 0;
    const column = Math.floor(((position[3 * i] ?? 0) - corner_m[0]) * px_per_m);
    const row = Math.floor((corner_m[1] - (position[3 * i + 1] ?? 0)) * px_per_m);
    if (z > shown.cut_m || column < 0 || row < 0 || column >= width || row >= height) continue;
    const cell = row * width + column;
    if (z <= (tops[cell] ?? 0)) continue;
    const classColour = shown.classes.get(kind[4 * i] ?? 0);
    const clipColour = shown.clips.get((kind[4 * i + 2] ?? 0) + 256 * (kind[4 * i + 3] ?? 0));
    if (!classColour || !clipColour) continue;
    tops[cell] = z;
    const colour = shown.colouring === "class" ? classColour
      : shown.colouring === "clip" ? clipColour
      : shown.colouring === "probability" ? ramped((kind[4 * i + 1] ?? 0) / 255)
      : null;
    for (let channel = 0; channel < 3; channel++) {
      pixels[4 * cell + channel] = colour?.[channel] ?? tint[4 * i + channel] ?? 0;
    }
    pixels[4 * cell + 3] = 255;
  }
  return pixels;
}
