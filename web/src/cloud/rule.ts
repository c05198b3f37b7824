// The line that is measured. Its widths are pixels of the screen: a person sees it from far away and on a dense screen.

import * as THREE from "three";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";
import { LineSegments2 } from "three/addons/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/addons/lines/LineSegmentsGeometry.js";
import type { Rgb } from "./colours.ts";
import type { Point3 } from "./pick.ts";
import { colorOf } from "./shapes.ts";

const LINE_PX = 4;
/** Around the line and the dots: the line is dark, and surfaces may be dark too. */
const EDGE_PX = 2.5;
export const EDGE: Rgb = [255, 255, 255];
const DOT_PX = 16;
/** Pixels along each side of the picture of a dot. */
const DOT_SIDE = 64;

function line(from: Point3, to: Point3, colour: Rgb, width_px: number): LineSegments2 {
  const geometry = new LineSegmentsGeometry().setPositions([...from, ...to]);
  // The marks are drawn in the order in which they were added, over everything.
  const material = new LineMaterial({ color: colorOf(colour), linewidth: width_px, depthTest: false, depthWrite: false, transparent: true });
  return new LineSegments2(geometry, material);
}

/** A disc with an edge. */
function dotPicture([red, green, blue]: Rgb): THREE.DataTexture {
  const pixels = new Uint8Array(4 * DOT_SIDE * DOT_SIDE);
  const whole = DOT_SIDE / 2;
  const inner = whole * (1 - (2 * EDGE_PX) / DOT_PX);
  for (let i = 0; i < DOT_SIDE * DOT_SIDE; i++) {
    const radius = Math.hypot((i % DOT_SIDE) + 0.5 - whole, Math.floor(i / DOT_SIDE) + 0.5 - whole);
    const colour = radius < inner ? [red, green, blue] : EDGE;
    // The last pixel fades out, so the disc is round.
    pixels.set([...colour, Math.round(255 * Math.min(1, Math.max(0, whole - radius)))], 4 * i);
  }
  const picture = new THREE.DataTexture(pixels, DOT_SIDE, DOT_SIDE);
  picture.colorSpace = THREE.SRGBColorSpace;
  picture.magFilter = picture.minFilter = THREE.LinearFilter;
  picture.needsUpdate = true;
  return picture;
}

function dots(ends: Point3[], colour: Rgb): THREE.Points {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.Float32BufferAttribute(ends.flat(), 3));
  const material = new THREE.PointsMaterial({
    map: dotPicture(colour), size: DOT_PX, sizeAttenuation: false, depthTest: false, depthWrite: false, transparent: true,
  });
  return new THREE.Points(geometry, material);
}

/** A line with a dot at each end; one dot while the line has one end. */
export function ruleOf(ends: Point3[], colour: Rgb): THREE.Object3D[] {
  const [from, to] = ends;
  const lines = from && to ? [line(from, to, EDGE, LINE_PX + 2 * EDGE_PX), line(from, to, colour, LINE_PX)] : [];
  const marks = [...lines, dots(ends, colour)];
  marks.forEach((mark, i) => (mark.renderOrder = i + 1));
  return marks;
}
