import { body, fake, type FakeElement } from "./dom.ts";
import assert from "node:assert/strict";
import { test } from "node:test";
import { CoveragePanel } from "../src/home/coverage.ts";
import type { HomeData } from "../src/home/data.ts";
import { Details } from "../src/home/details.ts";
import { Downloads } from "../src/home/downloads.ts";
import { LayersPanel } from "../src/home/layers.ts";
import { Looks } from "../src/home/looks.ts";
import { Measure } from "../src/home/measure.ts";
import type { Selection } from "../src/home/selection.ts";
import { ThingsPanel } from "../src/home/things.ts";

const room = { id: "r", name: "Kitchen", area_m2: 9, polygon_m: [], holes_m: [], source: "lidar_map", corrected: [] };
const sofa = { id: "sofa-1", name: null, class: "sofa", room: "r", confidence: 0.9, size_m: [1, 1, 1], clips: [], last_seen: null, corrected: [] };
const lamp = { ...sofa, id: "lamp-1", class: "lamp" };

/** The list and the card of a home, as its page joins them. */
function panels() {
  const page = new AbortController();
  const data = {
    home: { id: "h" }, rooms: [room], robotRooms: [], things: [sofa, lamp], clips: [], coverage: null, described: "1 main", classNamed: () => undefined,
  } as unknown as HomeData;
  const looks = new Looks();
  const measure = new Measure(page.signal);
  const select = (selection: Selection, isByKey: boolean) => {
    looks.select(selection);
    if (isByKey) details.focus();
  };
  const things = new ThingsPanel(data, looks, select);
  const details = new Details(data, looks, measure, () => {}, page.signal);
  body.replaceChildren(fake(details.element), fake(things.element), fake(measure.element));
  const card = fake(details.element);
  const find = (key: string) => {
    const found = body.querySelector(`[data-key="${key}"]`);
    assert.ok(found, `no element has the key ${key}`);
    return found;
  };
  const click = (element: FakeElement, clicks: number) => element.dispatchEvent(Object.assign(new Event("click"), { detail: clicks }));
  const escape = () => globalThis.dispatchEvent(Object.assign(new Event("keydown", { cancelable: true }), { key: "Escape" }));
  return { page, data, looks, measure, details, card, find, click, escape };
}

const focused = () => document.activeElement as unknown as FakeElement;

test("a selection by keys leads to its card, and Escape leads back to the row", () => {
  const { page, card, find, click, escape } = panels();
  find("object sofa-1").focus();
  click(focused(), 0);
  assert.equal(focused(), card);
  assert.equal(card.hidden, false);
  // The name of the card is read with the focus.
  assert.equal(card.getAttribute("aria-labelledby"), card.all("h2")[0]?.getAttribute("id"));
  escape();
  assert.equal(card.hidden, true);
  assert.equal(focused(), find("object sofa-1"));
  page.abort();
});

test("a class that a person set has no confidence", () => {
  const { page, data, details, looks, card, find } = panels();
  const told = () => [/Class(.*)Size/.exec(card.textContent)?.[1], find("object sofa-1").textContent];
  looks.select({ kind: "object", id: "sofa-1" });
  assert.deepEqual(told(), ["Sofa, 90 % sure", "SofaKitchen · 90 %"]);
  data.things = data.things.map((thing) => ({ ...thing, corrected: ["class"] }));
  details.draw();
  looks.change(() => {});
  assert.deepEqual(told(), ["Sofa, set by a person", "SofaKitchen · set by a person"]);
  page.abort();
});

test("a selection by a mouse leaves the focus in the list", () => {
  const { page, card, find, click, escape } = panels();
  find("object lamp-1").focus();
  click(focused(), 1);
  assert.equal(card.hidden, false);
  assert.equal(focused(), find("object lamp-1"));
  escape();
  assert.deepEqual([card.hidden, focused()], [true, find("object lamp-1")]);
  page.abort();
});

test("the focus stays in the card when its button is gone, and goes back to the row that opened it", () => {
  const { page, looks, card, find, click, escape } = panels();
  find("object sofa-1").focus();
  click(focused(), 0);
  // The link to the room of the object.
  find("r").focus();
  click(focused(), 0);
  assert.equal(card.all("h2")[0]?.textContent, "Kitchen");
  assert.equal(focused(), card);
  find("Close").focus();
  escape();
  assert.deepEqual([looks.selected, focused()], [null, find("object sofa-1")]);
  // The row does not get the focus of a card that was opened another way.
  looks.select({ kind: "object", id: "lamp-1" });
  find("Close").focus();
  escape();
  assert.equal(focused(), find("object lamp-1"));
  page.abort();
});

test("Escape ends a measurement, and the next one closes the card", () => {
  const { page, looks, measure, details, card, escape } = panels();
  looks.select({ kind: "room", id: "r" });
  measure.button.dispatchEvent(new Event("click"));
  escape();
  assert.deepEqual([measure.isOn, card.hidden], [false, false]);
  escape();
  assert.equal(card.hidden, true);
  // A room that is divided keeps its card.
  looks.select({ kind: "room", id: "r" });
  details.draw();
  const split = card.all("button").find(({ textContent }) => textContent === "Split");
  split?.dispatchEvent(new Event("click"));
  assert.deepEqual([measure.isAsked, card.hidden], [true, true]);
  escape();
  assert.deepEqual([measure.isOn, card.hidden, looks.selected?.id], [false, false, "r"]);
  page.abort();
});

test("a new map leaves the focus where it is", () => {
  const mapOf = (revision: number) => ({ revision, info: { points: revision, classes: [{ class: "wall", points: revision }] } });
  const data = {
    home: { id: "h" }, level: "main", hasLevels: false, clips: [], lidar: {}, rooms: [room], map: mapOf(1),
    coverage: { by_room: [{ room: "r", seen: 0.1, floor_seen: 0.1 }] }, classNamed: () => undefined,
  } as unknown as HomeData;
  const panels = [new CoveragePanel(data, () => {}), new LayersPanel(data, new Looks()), new Downloads(data)] as const;
  body.replaceChildren(...panels.map(({ element }) => fake(element)));
  const [coverage, layers, downloads] = panels;
  const part = () => [
    fake(coverage.element).all("button")[0], fake(layers.element).all("input").find(({ dataset }) => dataset.name === "wall"), fake(downloads.element).all("a")[0],
  ];
  part().forEach((_, i) => {
    const before = part()[i];
    assert.ok(before);
    before.focus();
    data.map = mapOf(i + 2) as unknown as HomeData["map"];
    data.coverage = { by_room: [{ room: "r", seen: (i + 2) / 10, floor_seen: 0.1 }] } as unknown as HomeData["coverage"];
    for (const panel of panels) panel.draw();
    assert.equal(focused(), part()[i], `element ${i} lost the focus`);
    assert.notEqual(focused(), body);
  });
});
