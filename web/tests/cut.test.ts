import { fake } from "./dom.ts";
import assert from "node:assert/strict";
import { test } from "node:test";
import * as THREE from "three";
import { Names } from "../src/cloud/names.ts";
import { partBelow, type Point3, type Ray } from "../src/cloud/pick.ts";
import { boxOf } from "../src/cloud/shapes.ts";
import type { HomeData } from "../src/home/data.ts";
import { LayersPanel } from "../src/home/layers.ts";
import { Looks } from "../src/home/looks.ts";
import type { Measure } from "../src/home/measure.ts";
import { Pointing } from "../src/home/pointing.ts";
import type { Thing } from "../src/types.ts";

const thing = (id: string, z_m: number, height_m: number, x_m = 2) =>
  ({ id, class: id, centre_m: [x_m, 0, z_m], size_m: [1, 1, height_m], yaw_rad: 0 }) as unknown as Thing;
const [table, lamp] = [thing("table", 0.4, 0.8), thing("lamp", 1.8, 0.4)];

test("a slider that cuts draws neither lists nor objects again", () => {
  const looks = new Looks();
  const told: (number | null | "all")[] = [];
  looks.onChange(() => told.push("all"));
  looks.onCut(() => told.push(looks.cut_m));
  const panel = new LayersPanel({ map: null } as unknown as HomeData, looks);
  const slider = fake(panel.element).all("input").find((input) => input.getAttribute("type") === "range");
  for (const value of ["1.2", "1.15", "1.15", "3"]) {
    if (slider) slider.value = value;
    slider?.dispatchEvent(new Event("input"));
  }
  assert.deepEqual(told, [1.2, 1.15, null]);
});

test("names of things above a cut are hidden, and those of cut ones lie at the cut", () => {
  const names = new Names();
  names.set([table, lamp].map(({ id, centre_m: [x, y, z], size_m: [, , height] }, i) =>
    ({ text: id, kind: "object", at_m: [x + 20 * i, y, z + height / 2], low_m: z - height / 2 })));
  const camera = new THREE.PerspectiveCamera(90);
  camera.position.set(12, 0, 30);
  camera.updateMatrixWorld();
  const hidden = () => {
    names.place({ camera, width: 400, height: 400 });
    return fake(names.element).all("span").map((name) => name.hidden);
  };
  assert.deepEqual(hidden(), [false, false]);
  names.cut_m = 1.7;
  assert.deepEqual(hidden(), [false, false]);
  names.cut_m = 0.5;
  assert.deepEqual(hidden(), [false, true]);
  const asked: number[] = [];
  names.hide((at) => asked.push(at.z) < 0);
  assert.equal(asked[0], 0.5);
});

test("the part of a thing below a cut is a box", () => {
  assert.equal(partBelow(table, 2), table);
  assert.equal(partBelow(lamp, 1.5), null);
  const { centre_m, size_m } = partBelow(table, 0.5) ?? table;
  assert.deepEqual([centre_m, size_m], [[2, 0, 0.25], [1, 1, 0.5]]);
});

test("a click goes through what is cut away", () => {
  const looks = new Looks();
  const data = { classes: [], rooms: [] } as unknown as HomeData;
  const pointing = new Pointing(data, looks, { take: () => false } as unknown as Measure, () => null, () => [table, lamp]);
  const [origin, target]: Point3[] = [[0, 0, 2.4], [2, 0, 1.8]];
  const way = new THREE.Vector3(...target!).sub(new THREE.Vector3(...origin!)).normalize();
  const ray: Ray = { origin: origin!, direction: way.toArray() };
  const down: Ray = { origin: [2, 0, 3], direction: [0, 0, -1] };
  for (const [cut_m, at, straightDown] of [[null, "lamp", "lamp"], [1, undefined, "table"], [0.5, undefined, "table"]] as const) {
    looks.cut(cut_m);
    looks.select(null);
    pointing.clickInCloud(ray, 0.01);
    assert.equal(looks.selected?.id, at, `cut at ${cut_m}`);
    pointing.clickInCloud(down, 0.01);
    assert.equal(looks.selected?.id, straightDown, `cut at ${cut_m}`);
  }
});

test("the boxes of things end at the plane of the cut", () => {
  const cut = new THREE.Plane(new THREE.Vector3(0, 0, -1), 0.5);
  const { clippingPlanes } = boxOf(table, [0, 0, 0], [cut]).material as THREE.LineBasicMaterial;
  assert.deepEqual([clippingPlanes?.[0] === cut, cut.distanceToPoint(new THREE.Vector3(0, 0, 0.6)) < 0], [true, true]);
});
