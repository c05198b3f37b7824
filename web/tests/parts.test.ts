import assert from "node:assert/strict";
import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import { explanation, refusalOf } from "../src/api.ts";
import { clipColour, RAMP, rgb } from "../src/cloud/colours.ts";
import { emptyPoints } from "../src/cloud/ply.ts";
import { around, corners, place } from "../src/frames.ts";
import { takePaper } from "../src/paper.ts";
import { frameOf, fromAbove, ramped } from "../src/plan/raster.ts";
import { parse, toClip, toHome, toHomes } from "../src/route.ts";
import { kindOfName, kindOfZip } from "../src/upload/kind.ts";
import { area, bytes, count, decimal, degrees, idOf, metres, named, percent, plain, seconds } from "../src/words.ts";
import { adviceOf } from "../src/clip/advice.ts";
import { LAYOUT_WORDS, layoutWord } from "../src/clip/layouts.ts";
import { wantedRooms } from "../src/home/coverage.ts";
import { FILES, FOR } from "../src/home/files.ts";
import type { Clip, Coverage, Room } from "../src/types.ts";

const close = (a: readonly number[], b: readonly number[]) =>
  assert.ok(a.length === b.length && a.every((value, i) => Math.abs(value - (b[i] ?? NaN)) < 1e-9), `${a} is not ${b}`);

test("addresses are read as they are written", () => {
  for (const home of ["flat-3", "a/b", "ä ö", "100%", "#?&"]) {
    const view = new URLSearchParams({ at: "object.sofa-1", from: "1_2" });
    assert.deepEqual(parse(toHome(home)), { page: "home", home, view: new URLSearchParams() });
    assert.deepEqual(parse(toHome(home, view)), { page: "home", home, view });
    assert.deepEqual(parse(toClip(home, "c")), { page: "clip", home, clip: "c" });
  }
  const all = { text: "", attention: false, after: null };
  for (const hash of ["", "#/homes"]) assert.deepEqual(parse(hash), { page: "homes", asked: all });
  for (const asked of [all, { text: "a=b&c", attention: true, after: "#?&" }]) {
    assert.deepEqual(parse(toHomes(asked)), { page: "homes", asked });
  }
  for (const hash of ["#/x", "#/homes/a/b", "#/homes/a/clips/b/c", "#/homes/%"]) {
    assert.deepEqual(parse(hash), { page: "nowhere" }, hash);
  }
});

test("a home's id is made of its name", () => {
  assert.equal(idOf("Flat 3, Elm Street"), "flat-3-elm-street");
  assert.equal(idOf("  Größe & Café! "), "grosse-cafe");
  assert.equal(idOf("Łódź Ærø"), "lodz-aero");
  assert.equal(idOf("家"), "home");
  assert.ok(/^[a-z0-9-]{1,100}$/.test(idOf("long ".repeat(50))));
});

test("a clip's points are turned, then moved", () => {
  close(place({ x_m: 2, y_m: 3, yaw_rad: Math.PI / 2 }, [1, 0]), [2, 4]);
  const box = corners([1, 1, 0], [2, 4, 1], Math.PI / 2);
  close(around(box)?.min ?? [], [-1, 0]);
  close(around(box)?.max ?? [], [3, 2]);
  assert.equal(around([]), null);
});

test("colours are told apart", () => {
  assert.deepEqual(rgb("#0a10ff"), [10, 16, 255]);
  assert.deepEqual(rgb("red"), [154, 154, 154]);
  const first = Array.from({ length: 24 }, (_, i) => clipColour(i).join());
  assert.equal(new Set(first).size, 24);
  assert.deepEqual([ramped(0), ramped(1), ramped(-1)], [RAMP[0], RAMP.at(-1), RAMP[0]]);
});

test("paper is taken away and ink keeps its look on white", () => {
  const inks = [[255, 255, 255], [52, 58, 64], [219, 234, 254], [0, 0, 0]];
  const pixels = new Uint8ClampedArray(inks.flatMap((ink) => [...ink, 255]));
  takePaper(pixels, false);
  assert.deepEqual([pixels[3], pixels[15]], [0, 255]);
  inks.forEach((ink, i) => ink.forEach((value, channel) => {
    const opacity = (pixels[4 * i + 3] ?? 0) / 255;
    const onWhite = (pixels[4 * i + channel] ?? 0) * opacity + 255 * (1 - opacity);
    assert.ok(Math.abs(onWhite - value) < 3, `${ink} became ${onWhite}`);
  }));
  const dark = new Uint8ClampedArray([0, 0, 0, 255]);
  takePaper(dark, true);
  assert.deepEqual([...dark], [255, 255, 255, 255]);
});

test("from above the highest shown point is seen", () => {
  const points = emptyPoints(3);
  // Two over each other, one beside them; classes 1, 2 and 1.
  points.position.set([0, 0, 0.1, 0, 0, 2, 1, 1, 0.1]);
  points.kind.set([1, 255, 0, 0, 2, 255, 0, 0, 1, 0, 0, 0]);
  const frame = frameOf({ min: [0, 0], max: [1, 1] }, 0.1);
  const shown = {
    colouring: "class" as const, cut_m: Infinity,
    classes: new Map([[1, [1, 1, 1] as [number, number, number]], [2, [2, 2, 2] as [number, number, number]]]),
    clips: new Map([[0, [3, 3, 3] as [number, number, number]]]),
  };
  const at = (pixels: Uint8ClampedArray) =>
    [0, 1].flatMap((i) => pixels.filter((_, at) => at % 4 === 0 && pixels[at + 3] === 255)[i] ?? []);
  // Rows go down: the point at y = 1 comes first.
  assert.deepEqual(at(fromAbove(points, 3, frame, shown)), [1, 2]);
  assert.deepEqual(at(fromAbove(points, 3, frame, { ...shown, cut_m: 1 })), [1, 1]);
  const hidden = { ...shown, classes: new Map([...shown.classes].filter(([id]) => id === 1)) };
  assert.deepEqual(at(fromAbove(points, 3, frame, hidden)), [1, 1]);
  assert.deepEqual(at(fromAbove(points, 3, frame, { ...shown, colouring: "clip" })), [3, 3]);
  assert.deepEqual(at(fromAbove(points, 3, frame, { ...shown, clips: new Map() })), []);
});

test("files are told apart by name and, zips, by what they list", () => {
  for (const name of ["valetudo.json", "MAP.YAML", "points.csv", "a.b.ply", "roborock.bin"]) assert.equal(kindOfName(name), "map");
  for (const name of ["clip.zip", "clip"]) assert.equal(kindOfName(name), null);
  for (const name of ["recording.r3d", "scan.db", "bag_0.mcap"]) assert.equal(kindOfName(name), "clip");
  // As APPNOTE 4.3.12 has it: a signature, the name's length at 28, the name at 46.
  const entry = (name: string) => `PK\u0001\u0002${"\0".repeat(24)}${String.fromCharCode(name.length)}${"\0".repeat(17)}${name}`;
  const zip = (...names: string[]) => new TextEncoder().encode(`rGb/_${names.map(entry).join("")}`);
  assert.equal(kindOfZip(zip("color/0.jpg", "depth/0.png", "pose/0.txt")), "clip");
  assert.equal(kindOfZip(zip("frame-000000.color.png")), "clip");
  assert.equal(kindOfZip(zip("map.yaml", "map.pgm")), "map");
  assert.equal(kindOfZip(zip("notes.txt")), null);
});

test("a refusal is told in the service's own words", () => {
  assert.equal(explanation(413, '{"title":"Too large","detail":"at most 1 GiB"}'), "at most 1 GiB");
  assert.equal(explanation(413, '{"title":"Too large"}'), "Too large");
  assert.equal(explanation(502, "<html>"), "The service answered with status 502.");
  assert.match(explanation(413, "<html>"), /^A proxy before the service /);
  assert.equal(explanation(0, ""), "The service does not answer.");
});

test("figures are short and never say more than is known", () => {
  const shares: [number | null, string][] = [
    [null, "–"], [0, "0 %"], [0.001, "< 1 %"], [0.634, "63 %"], [0.9997, "> 99 %"], [1, "100 %"],
  ];
  for (const [share, text] of shares) assert.equal(percent(share), text);
  assert.deepEqual([bytes(999), bytes(4_200_000), bytes(2e9)], ["999 B", "4.2 MB", "2.00 GB"]);
  assert.deepEqual([seconds(0.0021), seconds(0.34), seconds(12.34)], ["2 ms", "0.34 s", "12.3 s"]);
  assert.equal(plain("washing_machine"), "Washing machine");
});

test("every layout that the service reads is spelled as its maker spells it", () => {
  // `npm test` runs in `web/`.
  const folder = join(process.cwd(), "../crates/viola-formats/src/clip/layout");
  const sources = readdirSync(folder).filter((name) => name.endsWith(".rs")).map((name) => readFileSync(join(folder, name), "utf8"));
  // The names stand in calls; those of Nerfstudio stand in tuples with the source of the upward axis.
  const read = sources.flatMap((text) => [...text.matchAll(/Layout::new\(\s*"(\w+)"|\("(\w+)", (?:ARKIT_UP|"(?:unknown|world))/g)]);
  const names = new Set(read.map(([, called, listed]) => called ?? listed ?? ""));
  assert.ok(names.size > 10, `only ${[...names]}`);
  assert.deepEqual(Object.keys(LAYOUT_WORDS).sort(), [...names].sort());
  assert.deepEqual(["scannet", "tum_rgbd", "stray_scanner", "new_app"].map(layoutWord), ["ScanNet", "TUM RGB-D", "Stray Scanner", "New app"]);
});

test("numbers are written as the language of the browser writes them", () => {
  const comma = new Intl.NumberFormat(undefined, { minimumFractionDigits: 1 }).format(0.5).slice(1, 2);
  for (const [text, expected] of [
    [decimal(1234.5, 2), "1234.50"], [bytes(4_200_000), "4.2 MB"], [count(12_345_678), "12.35 M"], [seconds(0.34), "0.34 s"],
    [bytes(999_499), "999 kB"], [bytes(999_500), "1.0 MB"], [bytes(999_950_000), "1.00 GB"], [count(999_499), "999 k"], [count(999_500), "1.00 M"],
    [decimal(-0.001, 2), "0.00"], [degrees(-0.0001), "0.0°"],
    [metres(2.5), "2.50 m"], [metres(0.025), "2.5 cm"], [area(12.34), "12.3 m²"], [degrees(Math.PI / 8), "22.5°"],
  ] as const) {
    assert.equal(text, expected.replace(".", comma));
  }
  assert.notEqual(decimal(-0.006, 2), decimal(0.006, 2), "a number lost its sign");
});

test("a name from right to left does not turn the sentence around it", () => {
  assert.equal(named("Kitchen 2"), "Kitchen 2");
  for (const name of ["مطبخ", "מטבח 2"]) assert.equal(named(name), `\u2068${name}\u2069`);
});

test("problems that only programs understand are told in plain words", () => {
  const detail = "PUT /v1/homes/{home} makes one";
  const told = (code: string) => refusalOf(404, JSON.stringify({ type: `urn:viola:problem:${code}`, title: "No", detail }), "7");
  const [known, other] = [told("home-not-found"), told("a-new-code")];
  assert.match(known.message, /^There is no home at this address/);
  assert.deepEqual([known.detail, known.retryAfter_s, other.message, other.detail], [detail, 7, detail, null]);
});

test("the words of a problem may be about one field", () => {
  const told = (code: string, field: string | null) =>
    refusalOf(422, JSON.stringify({ type: `urn:viola:problem:${code}`, title: "No", detail: `${field} is wrong`, field }), null).message;
  assert.match(told("invalid-body", "split_by"), /^The line does not divide the room/);
  assert.equal(told("invalid-body", "from_m"), "from_m is wrong");
  assert.equal(told("home-not-found", "home"), told("home-not-found", null));
  assert.equal(told("invalid-path", "clip"), told("clip-not-found", null));
});

test("a clip without a certain place gets advice, and any other none", () => {
  const clip = (state: string, codes: string[], probability: number | null = null) => ({
    state, choice: null, placement: null, reasons: codes.map((code) => ({ code, detail: code })),
    alignment: probability === null ? null : { alternatives: [{ probability }] },
  }) as unknown as Clip;
  assert.match(adviceOf(clip("failed", ["no_support"]))[0] ?? "", /^Probably not this home/);
  assert.match(adviceOf(clip("ambiguous", ["weak_evidence", "not_this_home"], 0.05))[0] ?? "", /^Probably not this home/);
  assert.match(adviceOf(clip("ambiguous", ["weak_evidence"], 0.7))[0] ?? "", /^Film more of the walls/);
  assert.match(adviceOf(clip("failed", ["a_new_code"], 0))[0] ?? "", /^Film again/);
  assert.deepEqual(adviceOf(clip("aligned", [], 0.97)), []);
  assert.deepEqual(adviceOf(clip("aligning", [])), []);
});

test("the room with the longest walls that no clip shows is wanted first", () => {
  const square = (side: number) => [[0, 0], [side, 0], [side, side], [0, side]];
  const rooms = ["a", "b", "c", "d"].map((id, i) => ({ id, polygon_m: square([3, 9, 5, 1][i] ?? 0) })) as unknown as Room[];
  const by_room = [["a", 0.4], ["b", 0.9], ["c", 0.45], ["d", 0], ["gone", 0]].map(([room, seen]) => ({ room, seen, floor_seen: 0 }));
  const coverage = { by_room } as unknown as Coverage;
  assert.deepEqual(wantedRooms({ rooms, coverage }).map(({ id }) => id), ["c", "a", "d"]);
  assert.deepEqual(wantedRooms({ rooms, coverage: null }), []);
});

test("every file for download has a group, a row and an address of its own", () => {
  assert.deepEqual([...new Set(FILES.map(({ group }) => group))].sort(), [...FOR].sort());
  assert.equal(new Set(FILES.map(({ path }) => path.join("/"))).size, FILES.length);
  assert.equal(new Set(FILES.map(({ word, format }) => `${word} ${format}`)).size, FILES.length);
});
