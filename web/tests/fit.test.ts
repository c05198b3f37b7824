import assert from "node:assert/strict";
import { test } from "node:test";
import * as THREE from "three";
import { fitted, freePart } from "../src/cloud/fit.ts";

const CORNER = new THREE.Vector3(-0.55, -0.85, 0.95);
const ABOVE = new THREE.Vector3(0, -0.001, 1);

/** A long home with a tower at one end: its box would leave most of the picture empty. */
const HOME = [[0, 0, 0], [12, 0, 0], [12, 4, 0], [0, 4, 0], [11, 3, 5]].map(([x, y, z]) => new THREE.Vector3(x, y, z));

test("a scene fills the free part of a picture and no more", () => {
  for (const direction of [CORNER, ABOVE]) {
    for (const [aspect, part] of [
      [1.8, { left: -0.9, right: 0.9, bottom: -0.9, top: 0.7 }],
      [0.5, { left: -0.8, right: 0.8, bottom: -0.95, top: 0.3 }],
    ] as const) {
      const camera = new THREE.PerspectiveCamera(50, aspect, 0.01, 1000);
      const up = Math.tan(THREE.MathUtils.degToRad(25));
      const { eye_m, target_m } = fitted(HOME, direction, [up * aspect, up], part);
      camera.up.set(0, 0, 1);
      camera.position.fromArray(eye_m);
      camera.lookAt(...target_m);
      camera.updateMatrixWorld();
      const seen = HOME.map((point) => point.clone().project(camera));
      const [xs, ys] = [seen.map(({ x }) => x), seen.map(({ y }) => y)];
      const gaps = [Math.min(...xs) - part.left, part.right - Math.max(...xs), Math.min(...ys) - part.bottom, part.top - Math.max(...ys)];
      assert.ok(gaps.every((gap) => gap > -1e-6), `a point is outside of the part: ${gaps}`);
      // The eye is as near as it can be: along one axis, points touch both edges.
      const [across, upward] = [Math.max(gaps[0] ?? 1, gaps[1] ?? 1), Math.max(gaps[2] ?? 1, gaps[3] ?? 1)];
      assert.ok(Math.min(across, upward) < 1e-6, `the scene could be larger: ${gaps}`);
    }
  }
});

test("tools leave a low picture a part for the scene", () => {
  const { bottom, top } = freePart(390, 200, 150);
  assert.ok(top - bottom >= 0.79 && top < 1, `${bottom} to ${top}`);
  const both = freePart(390, 200, 150, 60);
  assert.ok(both.top - both.bottom >= 0.79 && both.bottom >= bottom, `${both.bottom} to ${both.top}`);
});

test("notes at the bottom of a picture have no scene below them", () => {
  const [free, noted] = [freePart(390, 520, 80), freePart(390, 520, 80, 40)];
  assert.equal(noted.top, free.top);
  assert.ok(Math.abs(noted.bottom - free.bottom - 80 / 520) < 1e-9, `${free.bottom} to ${noted.bottom}`);
});
