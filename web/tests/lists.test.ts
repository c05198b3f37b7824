import { body, fake } from "./dom.ts";
import assert from "node:assert/strict";
import { test } from "node:test";
import * as THREE from "three";
import { Names } from "../src/cloud/names.ts";
import { attentionOf, nextStepOf, withAttention } from "../src/home/attention.ts";
import { h, keepFocus } from "../src/dom.ts";
import { HomeData } from "../src/home/data.ts";
import { Details } from "../src/home/details.ts";
import { Looks } from "../src/home/looks.ts";
import { Measure } from "../src/home/measure.ts";
import { hullOfSelected } from "../src/home/selection.ts";
import { Summary } from "../src/home/summary.ts";
import { synonymsOf } from "../src/home/synonyms.ts";
import { ThingsPanel } from "../src/home/things.ts";
import type { Home, Thing } from "../src/types.ts";

const none = { uploaded: 0, queued: 0, aligning: 0, aligned: 0, ambiguous: 0, failed: 0 };

test("the reasons for attention are told with the next step", () => {
  for (const [needs_attention, counts, lidar_map_revision, told] of [
    [[], {}, 1, []],
    [["waiting"], { uploaded: 2 }, null, ["2 clips wait for the LiDAR map: add it"]],
    [["waiting"], { uploaded: 1 }, 3, ["1 clip was stopped: find its place again"]],
    [["waiting"], { uploaded: 2 }, 3, ["2 clips were stopped: find their places again"]],
    [["ambiguous", "failed"], { ambiguous: 1, failed: 3 }, 1,
      ["1 clip has no certain place: choose it, or film again", "3 clips have no place: see why"]],
    [["service_fault"], { queued: 2 }, 1, ["clips wait because of a fault of the service, which tries again: if it lasts, tell the operator"]],
    [["map_failing"], {}, 1, ["the map cannot be made: tell the operator of the service"]],
    [["a_new_reason"], {}, 1, ["a new reason"]],
  ] as const) {
    const home = { needs_attention: [...needs_attention], clips_by_state: { ...none, ...counts }, lidar_map_revision };
    assert.deepEqual(attentionOf(home as unknown as Home), [...told]);
  }
});

test("a home without clips has a next step", () => {
  assert.equal(nextStepOf({ clips: 0, lidar_map_revision: null }), "Add the LiDAR map of the robot vacuum");
  assert.equal(nextStepOf({ clips: 0, lidar_map_revision: 2 }), "Film the rooms and add the clips");
  assert.equal(nextStepOf({ clips: 1, lidar_map_revision: null }), null);
});

test("homes that need attention come first, also those of later pages", () => {
  const homes = (text: string) =>
    text.split("").map((id) => ({ id, needs_attention: id === id.toUpperCase() ? ["failed"] : [] })) as unknown as Home[];
  const list = withAttention({ items: homes("abCd"), next: "d" }, { items: homes("CX"), next: null });
  assert.deepEqual([list.items.map(({ id }) => id).join(""), list.next], ["CXabd", "d"]);
});

test("an object is found by the words that people use for it", () => {
  const things = ["sofa", "refrigerator", "television", "lamp", "box", "desk"].map((name) =>
    ({ id: `${name}-1`, class: name, name: null, room: null, confidence: 0.9, corrected: [] })) as unknown as Thing[];
  const data = { rooms: [], robotRooms: [], things, classNamed: () => undefined } as unknown as HomeData;
  const panel = new ThingsPanel(data, new Looks(), () => {});
  body.replaceChildren(fake(panel.element));
  const found = (text: string) => {
    const [search] = fake(panel.element).all("input");
    if (search) search.value = text;
    search?.dispatchEvent(new Event("input"));
    return fake(panel.element).all("button").map((row) => row.all("span").find(({ className }) => className === "word")?.textContent);
  };
  for (const [text, name] of [
    ["couch", "Sofa"], ["Fridge", "Refrigerator"], ["TV", "Television"], ["light", "Lamp"], ["trash", "Box"], ["sofa", "Sofa"], ["desk", "Desk"],
  ] as const) {
    assert.deepEqual(found(text), [name], text);
  }
  assert.deepEqual(found("elephant"), []);
  assert.equal(synonymsOf("a_new_class"), "");
});

test("rooms are listed by their names and numbers", () => {
  const rooms = ["Living room", "Bedroom 10", "Bathroom", "Bedroom 9"].map((name) => ({ id: name, name, area_m2: 9 }));
  const panel = new ThingsPanel({ rooms, things: [], classNamed: () => undefined } as unknown as HomeData, new Looks(), () => {});
  const rows = fake(panel.element).all("button").map((row) => row.all("span").find(({ className }) => className === "word")?.textContent);
  assert.deepEqual(rows, ["Bathroom", "Bedroom 9", "Bedroom 10", "Living room"]);
});

test("the rooms of the robot's map are listed and shown until a clip has its place", async () => {
  const [kitchen, other] = [{ id: "17", name: "Kitchen", area_m2: 16 }, { id: "18", name: null, area_m2: 4 }].map((one) => ({ ...one, centre_m: [3, 5] }));
  const lidar = { level: "upper", info: { rooms: [kitchen, other] } };
  const answers: Record<string, unknown> = {
    "": { id: "h", name: null }, "/lidar-maps": { items: [lidar] }, "/clips?limit=200": { items: [], next: null }, "/map": null,
  };
  const fetch = globalThis.fetch;
  globalThis.fetch = async (path) => {
    const answer = String(path) === "/v1/classes" ? { classes: [] } : answers[String(path).replace("/v1/homes/h", "")];
    return new Response(JSON.stringify(answer), { status: answer === null ? 404 : 200 });
  };
  const data = await HomeData.load("h", null, new AbortController().signal).finally(() => (globalThis.fetch = fetch));
  const looks = new Looks();
  const panel = new ThingsPanel(data, looks, (selection) => looks.select(selection));
  const card = new Details(data, looks, new Measure(new AbortController().signal), () => {}, new AbortController().signal);
  const text = () => fake(panel.element).all("li").map((row) => row.textContent);
  assert.deepEqual(text(), ["Rooms · 20.0 m²", "Kitchen16.0 m²", "Room 184.0 m²", "Objects appear when a clip has its place."]);
  fake(panel.element).all("button")[0]?.dispatchEvent(new Event("click"));
  // The map of the clips gives rooms of other levels than "main" such ids.
  assert.deepEqual(looks.selected, { kind: "room", id: "upper~17" });
  assert.match(fake(card.element).textContent, /^Kitchen✕Area16\.0 m²Fromthe robot's map/);
  assert.deepEqual(fake(card.element).all("button").map(({ textContent }) => textContent), ["✕"], "a room is corrected in the map of the clips only");
  const [xs, ys] = [0, 1].map((axis) => hullOfSelected(data, { kind: "room", id: "upper~17" }).map((point) => point[axis] ?? NaN));
  assert.deepEqual([Math.min(...(xs ?? [])), Math.max(...(xs ?? [])), Math.min(...(ys ?? [])), Math.max(...(ys ?? []))], [1, 5, 3, 7]);
  // The map of the clips has outlines; until they are read, no list of other rooms flashes up.
  data.map = { levels: [{ level: "upper" }] } as unknown as HomeData["map"];
  assert.deepEqual(data.robotRooms, []);
});

test("the row that goes gives the focus to the heading of its section", () => {
  const [summary, list] = [h("summary", {}, "Clips"), h("ul", {}, h("button", { "data-key": "delete 1" }), h("button", { "data-key": "delete 2" }))];
  body.replaceChildren(fake(summary), fake(list));
  Object.assign(list, { closest: () => ({ querySelector: () => summary }) });
  const [first, second] = fake(list).all("button");
  first?.focus();
  keepFocus(list, () => second && fake(list).replaceChildren(second));
  assert.equal(document.activeElement, summary);
  second?.focus();
  keepFocus(list, () => list.replaceChildren(h("button", { "data-key": "delete 2" })));
  assert.equal(document.activeElement, fake(list).all("button")[0]);
});

test("a name is hidden until a picture has placed it, and keeps its place after that", () => {
  const names = new Names();
  const name = { text: "Sofa", at_m: [0, 0, 0] as [number, number, number], kind: "object" as const };
  const elements = () => fake(names.element).all("span");
  names.set([name]);
  assert.deepEqual(elements().map(({ hidden }) => hidden), [true]);
  const camera = new THREE.PerspectiveCamera();
  camera.position.set(0, 0, 5);
  camera.updateMatrixWorld();
  names.place({ camera, width: 200, height: 100 });
  const [placed] = elements();
  assert.deepEqual([placed?.hidden, placed?.style.transform], [false, "translate(100.0px, 50.0px) translate(-50%, -50%)"]);
  names.set([name, { ...name, text: "Lamp", at_m: [NaN, 0, 0] }]);
  assert.equal(elements()[0], placed);
  names.place({ camera, width: 200, height: 100 });
  assert.deepEqual(elements().map(({ hidden }) => hidden), [false, true]);
});

test("walls of its own room do not hide a room's name from above", () => {
  const names = new Names();
  const asked: number[] = [];
  names.set([{ text: "Kitchen", at_m: [0, 0, 0], kind: "room" }, { text: "Sofa", at_m: [0, 0, 0.8], kind: "object" }]);
  names.hide((at) => asked.push(at.z) < 0);
  assert.deepEqual(asked, [2, 0.8]);
});

test("the map is promised for the time when all clips have settled, or when the service waits no longer", () => {
  const told = (states: string[], map: object | null = null, placement: object | null = null) => {
    const clips = states.map((state, i) => ({ id: String(i), state, placement }));
    const data = { home: { map_state: "due" }, level: "main", map, lidar: {}, coverage: null, clips, levelOf: () => "main" };
    const { empty, figures } = new Summary(data as unknown as HomeData, new Looks());
    return map ? (figures.textContent ?? "") : (empty.textContent ?? "");
  };
  for (const [states, text] of [
    [["aligning"], "The clips are being placedThe map is made when all clips have settled, or 10 minutes after the first one."],
    [["aligned", "queued", "aligning"],
      "The clips are being placedThe map is made when all clips have settled, or 10 minutes after the first one: 2 clips of 3 are left."],
    [["aligned", "failed"], "The map is being madeAll clips have settled. The map appears here by itself."],
  ] as const) {
    assert.equal(told([...states]), text);
  }
  const map = { revision: 2, state: "due", clips: [], levels: [], info: { points: 9 } };
  assert.match(told(["aligned", "queued"], map), / · rebuilt when all clips have settled, or after 10 minutes$/);
  // After a new LiDAR map all clips of the map are placed again.
  assert.match(told(["aligned", "queued"], map, { by: "clip" }), / · rebuilt when all clips have settled$/);
  assert.match(told(["aligned"], map), / · being rebuilt$/);
  assert.equal(told(["ambiguous"], { ...map, state: "current", info: { points: 0 } }), "Map 2 · no clip in it yet");
});
