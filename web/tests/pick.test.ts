import assert from "node:assert/strict";
import { test } from "node:test";
import { along, hullOf, type Point3, pointOn, type Ray, thingAbove, thingOn, throughBox } from "../src/cloud/pick.ts";
import { isInside } from "../src/frames.ts";
import { between } from "../src/home/measure.ts";
import type { Thing } from "../src/types.ts";

const thing = (id: string, centre_m: Point3, size_m: Point3, yaw_rad = 0): Thing => ({
  id, class: "table", name: null, confidence: 0.9, centre_m, size_m, yaw_rad, points: 10, clips: [], corrected: [],
  room: null, last_seen: null, level: "main",
});
const towards = (origin: Point3, target: Point3): Ray => {
  const way = target.map((value, axis) => value - (origin[axis] ?? 0));
  const length = Math.hypot(...way);
  return { origin, direction: way.map((value) => value / length) as Point3 };
};

test("a ray goes through a turned box where its faces are", () => {
  // A box of 2 m by 1 m that is turned by a quarter is 1 m wide along x.
  const box = thing("a", [5, 0, 0.5], [2, 1, 1], Math.PI / 2);
  const [enter, leave] = throughBox({ origin: [0, 0, 0.5], direction: [1, 0, 0] }, box) ?? [];
  assert.ok(Math.abs((enter ?? 0) - 4.5) < 1e-9 && Math.abs((leave ?? 0) - 5.5) < 1e-9, `${enter} to ${leave}`);
  assert.equal(throughBox({ origin: [0, 1.1, 0.5], direction: [1, 0, 0] }, box), null);
  assert.equal(throughBox({ origin: [10, 0, 0.5], direction: [1, 0, 0] }, box), null, "behind the eye");
  const ends = [0, 1, 2].flatMap((axis) => [Math.min, Math.max].map((end) => end(...hullOf(box).map((point) => point[axis] ?? NaN))));
  [4.5, 5.5, -1, 1, 0, 1].forEach((expected, i) => assert.ok(Math.abs((ends[i] ?? NaN) - expected) < 1e-9, `${ends}`));
});

test("the nearest shown point under a pixel is taken", () => {
  const positions = new Float32Array([4, 0, 0, 2, 0.001, 0, 3, 1, 0, -1, 0, 0]);
  const ray: Ray = { origin: [0, 0, 0], direction: [1, 0, 0] };
  assert.equal(pointOn(ray, positions, 4, 0.01, () => true), 2);
  assert.equal(pointOn(ray, positions, 4, 0.01, (i) => i !== 1), 4);
  assert.equal(pointOn(ray, positions, 1, 0.01, () => false), null);
});

test("a click takes the smallest box around the surface that it meets", () => {
  const table = thing("table", [2, 0, 0.4], [1.5, 1, 0.8]);
  const lamp = thing("lamp", [2, 0, 0.9], [0.2, 0.2, 0.3]);
  const behind = thing("behind", [4, 0, 0.4], [1, 1, 1]);
  const things = [table, lamp, behind];
  const ray = towards([0, 0, 0.9], [2, 0, 0.9]);
  assert.equal(thingOn(ray, things, 1.9)?.id, "lamp");
  assert.equal(thingOn(towards([0, 0, 0.3], [4, 0, 0.3]), things, 3.5)?.id, "behind", "the table has no point there");
  assert.equal(thingOn(ray, things, null)?.id, "lamp");
  assert.equal(thingOn(ray, things, 8), null, "the wall behind them was met");
  assert.equal(thingAbove([2, 0.05], things)?.id, "lamp");
  assert.equal(thingAbove([2.6, 0.4], things)?.id, "table");
  assert.equal(thingAbove([9, 9], things), null);
  assert.deepEqual(along(ray, 2), [2, 0, 0.9]);
});

test("a point is inside a room of any shape", () => {
  const shape: [number, number][] = [[0, 0], [4, 0], [4, 1], [1, 1], [1, 3], [0, 3]];
  for (const [point, isIn] of [[[3, 0.5], true], [[3, 2], false], [[0.5, 2.5], true], [[-1, 1], false]] as const) {
    assert.equal(isInside(shape, [...point]), isIn, String(point));
  }
});

test("a measured line tells its length along the floor", () => {
  assert.equal(between([0, 0, 0], [3, 4, 0]), "5.00 m");
  assert.equal(between([0, 0, 1], [3, 0, 0]), "3.16 m (3.00 m along the floor, 1.00 m down)");
});
