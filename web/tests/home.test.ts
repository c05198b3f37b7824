import assert from "node:assert/strict";
import { test } from "node:test";
import { Looks } from "../src/home/looks.ts";
import { progress } from "../src/home/measure.ts";
import { roomName, withoutLevel } from "../src/home/selection.ts";
import { read, written } from "../src/home/share.ts";
import { isBeingMade } from "../src/home/summary.ts";
import type { HomeData } from "../src/home/data.ts";

test("a view is read as it is written", () => {
  const looks = new Looks();
  looks.change((looks) => {
    looks.view = "2d";
    looks.colouring = "class";
    looks.clips = "ambiguous";
    looks.cut_m = 1.25;
    looks.layers.delete("lidar");
    looks.selected = { kind: "room", id: "upper~room-1" };
  });
  const viewpoint = { eye_m: [1, -2.5, 3] as [number, number, number], target_m: [0, 0, 0.25] as [number, number, number] };
  const query = new URLSearchParams(written(looks, "upper", viewpoint).toString());
  const again = new Looks();
  assert.deepEqual(read(query, again), viewpoint);
  assert.deepEqual([written(again, "upper", viewpoint).toString(), again.clips], [query.toString(), "ambiguous"]);
  read(new URLSearchParams("clips=nonsense"), again);
  assert.equal(again.clips, "ambiguous");
});

test("rooms without a name are numbered within their level", () => {
  assert.equal(roomName({ name: null, id: "room-2" }), "Room 2");
  assert.equal(roomName({ name: null, id: "upper~room-1" }), "Room 1");
  assert.equal(roomName({ name: "Kitchen", id: "upper~room-1" }), "Kitchen");
  assert.equal(withoutLevel("upper~sofa-1"), "sofa-1");
});

test("a measurement tells its state", () => {
  assert.equal(progress([], null, "Click two points."), "Click two points.");
  assert.equal(progress([], [1, 2, 0], "Click two points."), "Click two points. Enter takes x 1.00 m, y 2.00 m.");
  assert.equal(progress([[0, 0, 0]], null, ""), "Click the second point.");
  assert.match(progress([[0, 0, 0]], [3, 4, 0], ""), /^5\.00 m to x 3\.00 m, y 4\.00 m\. Enter takes the point/);
  assert.equal(progress([[0, 0, 0], [3, 4, 0]], [9, 9, 9], ""), "5.00 m");
});

test("the map is being made once a clip of the level has its place", () => {
  const home = (state: string, clips: string[] | null, level = "main") => ({
    level: "main", clips: [{ id: "a", state }], levelOf: () => level, map: clips && { clips: clips.map((clip) => ({ clip })) },
  }) as unknown as HomeData;
  assert.ok(isBeingMade(home("aligned", null)));
  assert.ok(isBeingMade(home("aligned", null, "upper")));
  assert.ok(isBeingMade(home("aligned", [])));
  assert.ok(!isBeingMade(home("aligned", [], "upper")));
  assert.ok(!isBeingMade(home("aligned", ["a"])));
  assert.ok(!isBeingMade(home("ambiguous", null)));
});
