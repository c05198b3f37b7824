import assert from "node:assert/strict";
import { test } from "node:test";
import * as THREE from "three";
import { LineSegments2 } from "three/addons/lines/LineSegments2.js";
import type { Rgb } from "../src/cloud/colours.ts";
import { EDGE, ruleOf } from "../src/cloud/rule.ts";
import { release } from "../src/cloud/shapes.ts";

const MARK: Rgb = [103, 65, 217];

/** The contrast of two colours (WCAG 2.2). */
function contrast(a: Rgb, b: Rgb): number {
  const luminance = (colour: Rgb) => {
    const [red = 0, green = 0, blue = 0] = colour.map((value) => (value <= 10 ? value / 255 / 12.92 : ((value / 255 + 0.055) / 1.055) ** 2.4));
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue;
  };
  const [light = 0, dark = 0] = [luminance(a), luminance(b)].sort((x, y) => y - x);
  return (light + 0.05) / (dark + 0.05);
}

test("a measured line is seen from any distance, over light and dark surfaces", () => {
  const marks = ruleOf([[0, 0, 0], [3, 4, 1]], MARK);
  const lines = marks.filter((mark) => mark instanceof LineSegments2).map(({ material }) => material);
  const [dots] = marks.filter((mark) => mark instanceof THREE.Points);
  const [edge, core] = lines;
  assert.ok(edge && core && dots && lines.length === 2);
  assert.ok(core.linewidth >= 3 && edge.linewidth >= core.linewidth + 4, `the line is ${core.linewidth} of ${edge.linewidth} pixels wide`);
  // A width in metres would be a fraction of a pixel far away.
  assert.deepEqual(lines.map(({ worldUnits }) => worldUnits), [false, false]);
  const { sizeAttenuation, size, map } = dots.material as THREE.PointsMaterial;
  assert.ok(!sizeAttenuation && size >= 12, `a dot is ${size} wide`);
  assert.equal(dots.geometry.getAttribute("position").count, 2);
  const { data, width } = (map as THREE.DataTexture).image as { data: Uint8Array; width: number };
  const pixel = (x: number) => [...data.slice(4 * ((width * width) / 2 + x), 4 * ((width * width) / 2 + x) + 4)];
  assert.deepEqual([pixel(width / 2), pixel(3)], [[...MARK, 255], [...EDGE, 255]]);
  assert.ok(contrast(MARK, EDGE) >= 4.5, `the line and its edge have a contrast of ${contrast(MARK, EDGE)}`);
  // A grey between both colours is the worst surface.
  for (const surface of [[255, 255, 255], [160, 160, 160], [90, 90, 90], [0, 0, 0], [103, 65, 217]] as Rgb[]) {
    const seen = Math.max(contrast(surface, MARK), contrast(surface, EDGE));
    assert.ok(seen >= 2.4, `the contrast to ${surface} is ${seen}`);
  }
  // Over everything, the edge first and the dots last.
  for (const { material } of [...marks] as THREE.Mesh[]) assert.equal((material as THREE.Material).depthTest, false);
  assert.deepEqual(marks.map(({ renderOrder }) => renderOrder), [1, 2, 3]);
});

test("one end is a dot, and all marks are given back to the graphics card", () => {
  const group = new THREE.Group().add(...ruleOf([[1, 2, 3]], MARK));
  assert.equal(group.children.length, 1);
  group.add(...ruleOf([[0, 0, 0], [1, 0, 0]], MARK));
  let given = 0;
  for (const mark of group.children as THREE.Points[]) {
    const { map } = mark.material as THREE.PointsMaterial;
    const parts = [mark.geometry, mark.material as THREE.PointsMaterial, ...(map ? [map] : [])];
    for (const part of parts) (part as THREE.EventDispatcher<{ dispose: object }>).addEventListener("dispose", () => given++);
  }
  release(group);
  // Two lines with two parts each, and two sets of dots with a picture each.
  assert.equal(given, 2 * 2 + 2 * 3);
  assert.equal(group.children.length, 0);
});
