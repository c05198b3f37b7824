import { fake } from "./dom.ts";
import assert from "node:assert/strict";
import { test } from "node:test";
import { alternatives, headingOf } from "../src/clip/alternatives.ts";
import { answer, files } from "../src/clip/facts.ts";
import { answerName, isLast, isOfEarlierMap, lastAnswerFigure, lastAnswerNote, withShownAnswer } from "../src/clip/last.ts";
import { chosenOf } from "../src/clip/pose.ts";
import { ClipsPanel } from "../src/home/clips.ts";
import type { HomeData } from "../src/home/data.ts";
import { Looks } from "../src/home/looks.ts";
import { read, written } from "../src/home/share.ts";
import { thumbnail } from "../src/parts/thumbnail.ts";
import type { Clip } from "../src/types.ts";

const pose = { x_m: 1, y_m: 2, yaw_rad: 0 };
const alignment = {
  level: "main", map_from_clip: pose, probability: 0.97, loss_m: 0.02, inliers: 0.9, coverage: 0.3, hits: 400, floor: null,
  labels: { by: "geometry" }, seconds: {},
  alternatives: [{ level: "main", map_from_clip: pose, probability: 0.97, inliers: 0.9, loss_m: 0.02, free_space: null, misplaced: null }],
};

/** A clip that was aligned to map 1 and is queued for another job. */
function waiting(members: object = {}): Clip {
  return {
    id: "c", home: "h", state: "queued", reasons: [], alignment: null, choice: null, placement: null, duplicate_of: null,
    last_answer: { alignment, lidar_map_revision: 1 }, job: { id: "j", lidar_map_revision: 2, state: "queued", progress: 0 },
    title: "Hall", recorded_at: null, created_at: "2026-03-14T15:09:26Z", size_bytes: 9, info: { frames: 60 }, ...members,
  } as unknown as Clip;
}

const aligned = waiting({ state: "aligned", alignment, last_answer: null });

test("a clip that waits for a new LiDAR map shows its last answer as such", () => {
  const clip = waiting();
  const shown = withShownAnswer(clip);
  assert.deepEqual([shown.alignment, shown.state, isLast(shown), isOfEarlierMap(shown)], [alignment, "queued", true, true]);
  assert.match(lastAnswerNote(clip) ?? "", /from the previous LiDAR map.* being placed again\.$/);
  assert.equal(headingOf(shown), "Places of the last answer");
  assert.match(fake(answer(shown) ?? assert.fail("there are no figures")).textContent, /97 %/);
  assert.match(fake(files(shown)).textContent, /Download the points/);
  const drawn = fake(alternatives(shown, { lidars: [], pictures: new Map(), scan: null }, null));
  assert.match(drawn.textContent, /^Drawn without walls.*Place 1/);
  const [{ alternatives: [first] }] = [alignment];
  const two = { ...shown, alignment: { ...alignment, alternatives: [first, first] } } as unknown as Clip;
  assert.match(fake(alternatives({ ...two, last_answer: { ...clip.last_answer, alignment: two.alignment } } as Clip,
    { lidars: [], pictures: new Map(), scan: null }, null)).textContent, /1 other place that was compared/);
  assert.deepEqual(drawn.all("button"), [], "a person cannot choose a place of the last answer");
});

test("an answer to the same LiDAR map, and one that no later answer followed, are told as such", () => {
  const again = waiting({ job: { id: "j", lidar_map_revision: 1 } });
  assert.equal(lastAnswerNote(again), "The last answer is shown below. The clip is being placed again.");
  assert.equal(lastAnswerFigure(again), "Last answer: 97 % sure, being placed again");
  const failed = waiting({ state: "failed" });
  assert.match(lastAnswerNote(failed) ?? "", /previous LiDAR map.* The newest attempt gave no answer\.$/);
  assert.equal(lastAnswerFigure(failed), "Last answer: 97 % sure, from the previous map");
  assert.deepEqual([lastAnswerNote(aligned), lastAnswerFigure(aligned), withShownAnswer(aligned)], [null, null, aligned]);
});

test("the files of the last answer and of the next one have different addresses", () => {
  const of = (clip: Clip) => fake(thumbnail(clip, "Hall")).all("img").map((picture) => picture.getAttribute("src"));
  assert.deepEqual([answerName(waiting()), answerName(aligned)], ["before-j", "j"]);
  assert.notDeepEqual(of(waiting()), of(aligned));
  assert.equal(of(waiting()).length, 1);
});

test("a choice in the new LiDAR map is not compared with places in the previous one", () => {
  const choice = { level: "main", map_from_clip: pose, alternative: 0 };
  assert.equal(chosenOf(withShownAnswer(waiting({ choice }))), null);
  assert.equal(chosenOf({ ...aligned, choice } as Clip), 0);
});

test("clips have switches in the points of the map and none in its surface", () => {
  const data = {
    clips: [aligned, { ...aligned, id: "d" }], map: { clips: [{ clip: "c" }] }, hasLevels: false, indexOf: () => 0, nameOf: () => "Hall",
    colourOf: () => [0, 0, 0],
  } as unknown as HomeData;
  const looks = new Looks();
  const { element } = new ClipsPanel(data, looks, () => {});
  const switches = () => fake(element).all("input").map((input) => [Reflect.get(input, "disabled"), Reflect.get(input, "title")]);
  const inPoints = [[true, "Not in the map"], [false, "Show in the map"]];
  assert.deepEqual(switches(), inPoints);
  looks.change((looks) => (looks.body = "surface"));
  assert.deepEqual(switches(), [[true, "Not in the map"], [true, "The surface shows all clips"]]);
  looks.change((looks) => (looks.body = "points"));
  assert.deepEqual(switches(), inPoints);
});

test("a clip whose file the home has already names the clip that the map uses", () => {
  const twin = { ...aligned, id: "d", title: "Again", duplicate_of: "c" };
  for (const [inMap, told] of [
    [["c"], "Same recording as Hall, which the map uses"], [["c", "d"], "Same recording as Hall"], [[], "Same recording as Hall"],
  ] as const) {
    const data = {
      clips: [aligned, twin], map: { clips: inMap.map((clip) => ({ clip })) }, hasLevels: false, indexOf: () => 0,
      nameOf: ({ title }: Clip) => title, colourOf: () => [0, 0, 0],
    } as unknown as HomeData;
    const notes = fake(new ClipsPanel(data, new Looks(), () => {}).element).all("p").filter(({ className }) => className === "same hint");
    assert.deepEqual(notes.map(({ textContent }) => textContent), [told]);
  }
});

test("the list of clips shows the last answer", () => {
  const clip = waiting();
  const data = {
    clips: [clip], map: null, hasLevels: false, indexOf: () => 0, nameOf: () => "Hall", colourOf: () => [0, 0, 0],
  } as unknown as HomeData;
  const { element } = new ClipsPanel(data, new Looks(), () => {});
  assert.match(fake(element).textContent, /60 framesLast answer: 97 % sure, from the previous map, being placed again$/);
});

test("of many clips the older ones are folded away until a person asks for them", () => {
  const clips = Array.from({ length: 35 }, (_, i) => ({ ...aligned, id: `c${i}` }));
  const data = {
    clips, map: { clips: [] }, hasLevels: false, indexOf: () => 0, nameOf: ({ id }: Clip) => id, colourOf: () => [0, 0, 0],
  } as unknown as HomeData;
  const looks = new Looks();
  const { element } = new ClipsPanel(data, looks, () => {});
  const rows = () => fake(element).all("li").filter(({ className }) => className.startsWith("clip "));
  assert.equal(rows().length, 30);
  assert.match(rows()[0]?.textContent ?? "", /^c34/, "the newest is not the first");
  const button = fake(element).all("button").find(({ textContent }) => textContent === "Show 5 older clips");
  button?.dispatchEvent(new Event("click"));
  assert.equal(rows().length, 35);
  assert.ok(!fake(element).textContent.includes("older"));
  // The browser's Back leads to the same list.
  const again = new Looks();
  read(written(looks, null, { from: null, part: null }), again);
  assert.ok(again.hasAllClips);
});
