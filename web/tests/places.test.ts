import { fake, type FakeElement } from "./dom.ts";
import assert from "node:assert/strict";
import { test } from "node:test";
import { adviceOf } from "../src/clip/advice.ts";
import { alternatives, headingOf } from "../src/clip/alternatives.ts";
import { files, hasPoints } from "../src/clip/facts.ts";
import { isDoubtful, mayBeForeign, mayLieElsewhere } from "../src/clip/plausible.ts";
import { reasonsOf } from "../src/clip/reasons.ts";
import type { Clip } from "../src/types.ts";

const pose = (x_m: number) => ({ x_m, y_m: 0, yaw_rad: 0 });

/** A clip whose places lie 5 m apart and have these probabilities. */
function clipWith(probabilities: (number | null)[], members: object = {}): Clip {
  const places = probabilities.map((probability, i) =>
    ({ level: "main", map_from_clip: pose(5 * i), probability, loss_m: 0.1, inliers: 0.8, free_space: null, misplaced: null }));
  const alignment = { level: "main", map_from_clip: pose(0), alternatives: places, hits: 200, labels: { by: "geometry" } };
  const clip = { state: "ambiguous", choice: null, placement: null, reasons: [], alignment, home: "h", id: "c", size_bytes: 9 };
  return { ...clip, ...members } as unknown as Clip;
}

const equal = Array.from({ length: 8 }, () => 0.12);

test("a clip with equal places may be of another home, and its places ask again", () => {
  for (const [probabilities, members, isForeign] of [
    [equal, {}, true], [[0.5, 0.4], {}, false], [[0.2, 0.1], {}, false], [[null, null], {}, false], [[], {}, false],
    [equal, { state: "failed" }, false], [equal, { choice: { level: "main", map_from_clip: pose(0) } }, false],
    [equal, { reasons: [{ code: "not_this_home", detail: "" }] }, false],
  ] as const) {
    const clip = clipWith([...probabilities], members);
    assert.equal(mayBeForeign(clip), isForeign, JSON.stringify([probabilities, members]));
    assert.equal(/^It may be of another home/.test(adviceOf(clip)[0] ?? ""), isForeign);
  }
  const [clip, sure] = [clipWith(equal), clipWith([0.7, 0.1])];
  const doubts = ({ alignment }: Clip) => alignment?.alternatives.map((one) => isDoubtful(sure, one));
  assert.deepEqual([doubts(clip)?.[0], doubts(sure)], [true, [false, true]]);
  const [one] = sure.alignment?.alternatives ?? [];
  assert.ok(one && isDoubtful({ ...sure, reasons: [{ code: "not_this_home", detail: "" }] }, one));
});

test("a place is obvious only if it is more probable than not and few homes are left", () => {
  for (const [probabilities, isObvious, isElsewhere, none] of [
    [[0.7, 0.1], true, false, "20 %"], [[0.6, 0.02], false, true, "38 %"], [[0.45, 0.45], false, false, "10 %"],
    [[0.5, 0.495], true, false, null], [[null, null], true, false, null],
  ] as const) {
    const clip = clipWith([...probabilities]);
    const list = fake(alternatives(clip, { lidars: [], pictures: new Map(), scan: null }, () => {}));
    assert.equal(list.all("button").some((button) => button.className === "primary"), isObvious, probabilities.join());
    assert.equal(mayLieElsewhere(clip), isElsewhere, probabilities.join());
    const told = list.all("p").find((part) => part.className === "none-right")?.textContent ?? null;
    assert.equal(told, none && `None of these places: ${none}`);
  }
});

test("advice is given once, and a pose is called a place", () => {
  const several = {
    code: "several_modes",
    detail: "3 other poses explain the clip nearly as well, which leaves the best at 40 %; film more of the room, or choose one",
  };
  const told = (clip: Clip) => reasonsOf(clip).map(({ text }) => text);
  const clip = clipWith([0.4, 0.3], { reasons: [several] });
  assert.deepEqual(told(clip), ["3 other places explain the clip nearly as well, which leaves the best at 40 %"]);
  assert.equal(adviceOf(clip).length, 1);
  assert.deepEqual(told(clipWith(equal, { reasons: [several] })), told(clip));
  const dark = { code: "track_dark", detail: "the picture is dark; switch on the light" };
  assert.deepEqual(told(clipWith([0.4, 0.3], { reasons: [dark] })), ["the picture is dark"]);
  // Without advice of the page, the service's stays.
  const fault = { code: "storage_fault", detail: "the disk is full; the service tries again by itself" };
  assert.deepEqual(told(clipWith([0.4], { state: "queued", reasons: [fault] })), [fault.detail]);
  const other = { code: "a_new_code", detail: "something happened; film again" };
  assert.deepEqual(told(clipWith([0.4, 0.3], { reasons: [several, other] })).at(-1), other.detail);
});

test("an aligned clip is headed by its answer, and its other places are folded away", () => {
  const chosen = { level: "main", map_from_clip: pose(5), alternative: 1 };
  for (const [clip, heading, shown, folded] of [
    [clipWith([0.98, 0.01, 0], { state: "aligned" }), "Its place", [0], "2 other places that were compared"],
    [clipWith([0.98], { state: "aligned" }), "Its place", [0], null],
    [clipWith([0.5, 0.4], { state: "aligned", choice: chosen }), "Its place: place 2, chosen by a person", [1], "1 other place that was compared"],
    [clipWith([0.5, 0.4]), "2 places that may be right", [0, 1], null],
    [clipWith([0.5, 0.4, 0.001]), "2 places that may be right", [0, 1], "1 place of less than 1 %"],
    [clipWith([0.5]), "The place that was found", [0], null],
    [clipWith([null], { state: "failed" }), "Places that were tried", [0], null],
    [clipWith([null, null, null], { state: "failed" }), "Places that were tried", [0], "2 other places that were compared"],
  ] as const) {
    assert.equal(headingOf(clip), heading);
    const list = fake(alternatives(clip, { lidars: [], pictures: new Map(), scan: null }, null));
    const [first, rest] = [list.all("ol")[0], list.all("details").find((part) => part.className === "less-likely")];
    const indices = (part: FakeElement | undefined) => part?.all("li").map((place) => Number(place.getAttribute("data-alternative")));
    assert.deepEqual(indices(first), [...shown]);
    assert.equal(rest?.all("summary")[0]?.textContent ?? null, folded);
    // A place without a probability has no bar of it.
    assert.equal(list.all("meter").length, clip.alignment?.alternatives.filter((one) => one.probability !== null).length);
  }
});

test("a clip offers the files that it has", () => {
  const words = (clip: Clip) => fake(files(clip)).all("a").map((link) => link.textContent);
  const empty = { labels: null, hits: 0, alternatives: [] };
  for (const [alignment, isThere] of [
    [{ labels: { by: "geometry" }, hits: 0 }, true], [{ labels: null, hits: 3 }, true], [empty, false], [null, false],
  ] as const) {
    const clip = clipWith([], { alignment });
    assert.equal(hasPoints(clip), isThere);
    assert.deepEqual(words(clip), ["Download the recording", ...(isThere ? ["Download the points"] : [])]);
  }
});
