import assert from "node:assert/strict";
import { test } from "node:test";
import { adviceOf, adviceOn } from "../src/clip/advice.ts";
import { isDoubtful } from "../src/clip/plausible.ts";
import { chosenOf, poseInForce } from "../src/clip/pose.ts";
import { reasonsOf } from "../src/clip/reasons.ts";
import type { Clip } from "../src/types.ts";
import { clipStateMeaning, clipStateWord, stateMeaning } from "../src/words.ts";

const pose = (x_m: number, yaw_rad = 0) => ({ x_m, y_m: 0, yaw_rad });

/** A clip with alternatives at 0, 5 and 5 m; the last one is on another level. */
function clipWith(members: object): Clip {
  const alternatives = [[0, "main"], [5, "main"], [5, "upper"]].map(([x_m, level]) => ({ level, map_from_clip: pose(Number(x_m)) }));
  return {
    state: "aligned", choice: null, placement: null, reasons: [],
    alignment: { level: "main", map_from_clip: pose(0), alternatives }, ...members,
  } as unknown as Clip;
}

const placement = (by: string, x_m: number) => ({ level: "main", map_from_clip: pose(x_m), by });

test("the alternative of the pose in force is chosen", () => {
  assert.equal(chosenOf(clipWith({})), 0);
  assert.equal(chosenOf(clipWith({ state: "ambiguous" })), null);
  assert.equal(chosenOf(clipWith({ placement: placement("neighbours", 5.2) })), 1);
  assert.equal(chosenOf(clipWith({ choice: { level: "upper", map_from_clip: pose(5), alternative: 0 } })), 2);
  assert.equal(chosenOf(clipWith({ placement: placement("alignment", 0.1), choice: { level: "main", map_from_clip: pose(5) } })), 1);
});

test("no alternative is chosen where none has the pose in force", () => {
  for (const map_from_clip of [pose(2.5), pose(0, 0.5), pose(0.31)]) {
    assert.equal(chosenOf(clipWith({ choice: { level: "main", map_from_clip, alternative: 1 } })), null);
  }
  // A whole turn is no turn.
  assert.equal(chosenOf(clipWith({ choice: { level: "main", map_from_clip: pose(0, 2 * Math.PI - 0.1) } })), 0);
});

test("the map's pose is no longer in force after its choice is withdrawn", () => {
  assert.equal(poseInForce(clipWith({ state: "ambiguous", placement: placement("person", 5) })), null);
});

test("places of a choice count from 1, and warnings come first", () => {
  const reasons = [{ code: "chosen_by_person", detail: "a person chose alternative 1" }, { code: "choice_of_earlier_lidar_map", detail: "old" }];
  const choice = { level: "main", map_from_clip: pose(5), alternative: 1 };
  const clip = clipWith({ choice, reasons });
  assert.deepEqual(reasonsOf(clip).map(({ text }) => text), ["old", "a person chose place 2"]);
  assert.match(adviceOf(clip)[0] ?? "", /Choose it again, or withdraw/);
  const elsewhere = clipWith({ choice: { ...choice, map_from_clip: pose(2.5) }, reasons });
  assert.equal(reasonsOf(elsewhere)[1]?.text, "a person chose place 2 of an earlier answer");
  const given = clipWith({ choice: { ...choice, alternative: null }, reasons: [{ code: "chosen_by_person", detail: "a person gave the pose" }] });
  assert.equal(reasonsOf(given)[0]?.text, "a person gave the pose");
  assert.deepEqual(adviceOf(given), []);
});

test("wrong units and conventions of the files come before doubts about the home", () => {
  const of = (codes: string[], probability: number) => clipWith({
    state: "ambiguous", reasons: codes.map((code) => ({ code, detail: `${code} is told; check the unit of the depth` })),
    alignment: { alternatives: [{ probability }] },
  });
  for (const [codes, probability, advice, second] of [
    [["scale_disagrees", "not_this_home"], 0.05, /^Check the unit of the clip/, /^Probably not this home/],
    [["scale_disagrees"], 0.1, /^Check the unit of the clip/, /^It may be of another home/],
    [["scale_disagrees"], 0.6, /^Check the unit of the clip/, null],
    [["tracked", "poses_disagree", "no_support"], 0.01, /^Correct the camera poses/, null],
    [["poses_disagree", "several_modes"], 0.4, /^Correct the camera poses/, null],
  ] as const) {
    const clip = of([...codes], probability);
    assert.equal(adviceOf(clip).length, second ? 2 : 1, codes.join());
    if (second) assert.match(adviceOf(clip)[1] ?? "", second);
    assert.ok(clip.alignment?.alternatives.every((one) => isDoubtful(clip, one)), "a place is offered without a question");
    assert.match(adviceOf(clip)[0] ?? "", advice);
    assert.match(reasonsOf(clip)[0]?.text ?? "", /^(scale|poses)_disagrees? is told$/);
  }
  assert.deepEqual(adviceOf(of(["poses_disagree", "scale_disagrees"], 0.5)).length, 2);
});

test("the doubt about the home is told first, and facts of the recording last", () => {
  const told = (codes: string[], members = {}) => reasonsOf(clipWith({
    state: "ambiguous", reasons: codes.map((code) => ({ code, detail: code })), ...members,
  })).map(({ code }) => code);
  for (const [codes, expected] of [
    [["several_modes", "not_this_home"], ["not_this_home", "several_modes"]],
    [["no_colour", "several_modes", "not_this_home"], ["not_this_home", "several_modes", "no_colour"]],
    [["tracked", "sparse_frames", "no_support"], ["no_support", "sparse_frames", "tracked"]],
    [["no_colour", "weak_evidence"], ["weak_evidence", "no_colour"]],
    [["several_modes", "not_this_home", "scale_disagrees"], ["scale_disagrees", "not_this_home", "several_modes"]],
  ] as const) {
    assert.deepEqual(told([...codes]), expected);
  }
  // A clip that its neighbours placed is of this home.
  const placed = ["decided_by_neighbours", "several_modes", "not_this_home"];
  assert.deepEqual(told(placed, { placement: placement("neighbours", 5) }), placed);
});

test("an unclear clip has its words and its advice also while an earlier map has a place of it", () => {
  const reasons = ["several_modes", "not_this_home"].map((code) => ({ code, detail: `${code} has 3 poses; film more of the room` }));
  for (const by of ["person", "alignment"]) {
    const clip = clipWith({ state: "ambiguous", reasons, placement: placement(by, 5) });
    assert.deepEqual(reasonsOf(clip).map(({ text }) => text), ["not_this_home has 3 places", "several_modes has 3 places"]);
    assert.match(adviceOf(clip)[0] ?? "", /^Probably not this home/);
  }
});

test("a row has the advice about the reason that it shows", () => {
  for (const [state, probability, codes, reason, advice] of [
    ["ambiguous", 0.4, ["weak_evidence", "several_modes"], "weak_evidence", /lower half/],
    ["ambiguous", 0.4, ["several_modes", "not_this_home"], "not_this_home", /^Probably not this home/],
    ["ambiguous", 0.1, ["several_modes", "no_floor"], "several_modes", /^It may be of another home/],
    ["ambiguous", 0.1, ["no_floor", "several_modes"], "no_floor", /floor in sight/],
    ["ambiguous", 0.4, ["weak_evidence", "several_scales", "several_modes", "search_incomplete"], "weak_evidence", /lower half/],
    ["failed", 0, ["a_new_code"], "a_new_code", /^Film again/],
    ["aligned", 0.9, ["track_dark"], "track_dark", null],
  ] as const) {
    const given = codes.map((code) => ({ code, detail: code }));
    const clip = clipWith({ state, reasons: given, alignment: { alternatives: [{ probability }] } });
    assert.equal(reasonsOf(clip)[0]?.code, reason);
    const told = adviceOn(clip, reason);
    if (advice) assert.match(told ?? "", advice);
    else assert.equal(told, null);
  }
});

test("a stopped clip says so, and names the button that places it", () => {
  const of = (code: string) => clipWith({ state: "uploaded", reasons: [{ code, detail: "the job was cancelled; align the clip to queue it again" }] });
  const [stopped, waiting] = [of("cancelled"), of("no_lidar_map")];
  assert.deepEqual([clipStateWord(stopped), clipStateWord(waiting)], ["Stopped", "Waiting"]);
  assert.deepEqual([clipStateMeaning(stopped), clipStateMeaning(waiting)], ["It is not being placed.", "It waits for a LiDAR map."]);
  assert.deepEqual(reasonsOf(stopped).map(({ text }) => text), ["a person stopped it"]);
  assert.deepEqual(adviceOf(stopped), ["Press “Find its place again”."]);
  assert.equal(adviceOn(stopped, "cancelled"), "Press “Find its place again” on its page.");
});

test("a fault of the filming comes before the doubt that the clip is of another home", () => {
  const of = (...codes: string[]) => adviceOf(clipWith({
    state: "ambiguous", reasons: codes.map((code) => ({ code, detail: code })), alignment: { alternatives: [{ probability: 0.1 }] },
  }));
  const [first, second, ...others] = of("no_floor", "several_modes", "track_dark");
  assert.match(first ?? "", /floor in sight/);
  assert.match(second ?? "", /^It may be of another home/);
  assert.deepEqual([others.length, of("several_modes").length], [0, 1]);
});

test("a damaged file is not a matter of filming, and one doubtful place is not several", () => {
  const failed = (codes: string[], alignment: object | null) =>
    adviceOf(clipWith({ state: "failed", alignment, reasons: codes.map((code) => ({ code, detail: code })) }));
  for (const [codes, alignment, advice] of [
    [["bad_picture"], null, /^The file is damaged/], [["a_new_code"], { alternatives: [] }, /^Film again/], [[], null, /^Film again/],
  ] as const) {
    assert.match(failed([...codes], alignment)[0] ?? "", advice);
  }
  assert.doesNotMatch(stateMeaning("failed"), /found/);
  assert.doesNotMatch(stateMeaning("ambiguous"), /several/i);
});
