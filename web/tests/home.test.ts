import assert from "node:assert/strict";
import { afterEach, mock, test } from "node:test";
import { home, makeHome, Refusal, renameHome } from "../src/api.ts";
import { inkOf } from "../src/paper.ts";
import { bytesOf } from "../src/cloud/resume.ts";
import { emptyPoints } from "../src/cloud/ply.ts";
import { Cloud } from "../src/cloud/points.ts";
import { Looks } from "../src/home/looks.ts";
import { progress } from "../src/home/measure.ts";
import { roomName, withoutLevel } from "../src/home/selection.ts";
import { deselectMissing, type Framing, read, written } from "../src/home/share.ts";
import { isBeingMade } from "../src/home/summary.ts";
import type { HomeData } from "../src/home/data.ts";
import { retryDelay_ms } from "../src/upload/retry.ts";

const real = { fetch: globalThis.fetch, timeout: AbortSignal.timeout };
afterEach(() => {
  globalThis.fetch = real.fetch;
  AbortSignal.timeout = real.timeout;
});

test("a home never gets the id of another one", async () => {
  for (const [status, name, id] of [[200, "家", "home"], [412, "Flat 3", "flat-3"]] as const) {
    const asked: string[] = [];
    globalThis.fetch = async (path, options) => {
      asked.push(`${options?.method} ${path} ${new Headers(options?.headers).get("if-none-match")}`);
      return new Response("{}", { status: asked.length === 1 ? status : 201 });
    };
    assert.match(await makeHome(name), new RegExp(`^${id}-[a-z]{4}$`));
    assert.deepEqual([asked.length, asked[0]], [2, `PUT /v1/homes/${id} *`]);
  }
});

test("a home whose answer was lost is not made twice", async () => {
  const unused = { name: "Elm Street", clips: 0, lidar_map_revision: null };
  for (const [found, id] of [
    [unused, /^elm-street$/], [{ ...unused, clips: 1 }, /^elm-street-[a-z]{4}$/], [{ ...unused, name: "Elm street" }, /^elm-street-[a-z]{4}$/],
  ] as const) {
    const homes = new Map<string, object>();
    let isLost = true;
    globalThis.fetch = async (path, options) => {
      if (options?.method !== "PUT") return new Response(JSON.stringify(homes.get(String(path))));
      if (homes.has(String(path))) return new Response("{}", { status: 412 });
      homes.set(String(path), found);
      if (!isLost) return new Response("{}", { status: 201 });
      isLost = false;
      return new Response("Bad gateway", { status: 502 });
    };
    await assert.rejects(makeHome("Elm Street"), (error) => error instanceof Refusal && error.status === 502);
    assert.match(await makeHome("Elm Street"), id);
    // Another home of the same name is a new one.
    assert.match(await makeHome("Elm Street"), /^elm-street-[a-z]{4}$/);
  }
});

test("an answer that stalls counts as none", async () => {
  const limit = new AbortController();
  AbortSignal.timeout = () => limit.signal;
  globalThis.fetch = async (_, options) => new Response(new ReadableStream({
    start: (stream) => options?.signal?.addEventListener("abort", () => stream.error(options.signal?.reason)),
  }));
  const read = home("h", new AbortController().signal);
  setTimeout(() => limit.abort());
  await assert.rejects(read, (error) => error instanceof Refusal && error.status === 0);
});

test("an answer that breaks off counts as none, so the page asks again by itself", async () => {
  const broken = () => new ReadableStream({ pull: (stream) => stream.error(new TypeError("network error")) });
  // A network that asks for a sign-in answers with a page of its own.
  for (const answer of [() => new Response(broken()), () => new Response(broken(), { status: 503 }), () => new Response("<html>")]) {
    globalThis.fetch = async () => answer();
    await assert.rejects(home("h", new AbortController().signal), (error) => error instanceof Refusal && retryDelay_ms(error, 1) === 1000);
  }
  globalThis.fetch = async () => new Response(broken(), { status: 404 });
  await assert.rejects(home("h", new AbortController().signal), (error) => error instanceof Refusal && error.isFinal);
  Object.assign(globalThis, { createImageBitmap: () => {} });
  globalThis.fetch = async () => new Response(broken(), { status: 503 });
  await assert.rejects(inkOf("/image.png", false, new AbortController().signal), (error) => error instanceof Refusal && error.status === 503);
  const left = new AbortController();
  globalThis.fetch = async () => new Response(new ReadableStream({ pull: (stream) => (left.abort(), stream.error(new TypeError("left"))) }));
  await assert.rejects(home("h", left.signal), TypeError, "a page that was left has lost nothing");
});

test("an action that stalls ends, and may have been done", async () => {
  const limit = new AbortController();
  AbortSignal.timeout = () => limit.signal;
  globalThis.fetch = (_, options) => new Promise((_, reject) => options?.signal?.addEventListener("abort", () => reject(options.signal?.reason)));
  const renamed = renameHome("h", "Flat");
  setTimeout(() => limit.abort());
  await assert.rejects(renamed, (error) => error instanceof Refusal && error.status === 0 && /may have done it/.test(error.message));
});

test("an action that is done is not told as failed if the rest of its answer is lost", async () => {
  globalThis.fetch = async () => new Response(new ReadableStream({ pull: (stream) => stream.error(new TypeError("network error")) }));
  await renameHome("h", "Flat");
});

test("a large answer may take its time, but not stall", async () => {
  mock.timers.enable({ apis: ["setTimeout"] });
  let stream: ReadableStreamDefaultController | undefined;
  let isCancelled = false;
  const body = () => new Response(new ReadableStream({ start: (begun) => void (stream = begun), cancel: () => void (isCancelled = true) }));
  const settle = () => new Promise((resolve) => setImmediate(resolve));
  const never = new AbortController().signal;
  const whole = bytesOf(body(), never);
  for (let piece = 0; piece < 5; piece++) {
    await settle();
    mock.timers.tick(50_000);
    stream?.enqueue(new Uint8Array([piece]));
  }
  stream?.close();
  assert.deepEqual([...new Uint8Array(await whole)], [0, 1, 2, 3, 4]);
  let end = "";
  const stalled = bytesOf(body(), never).catch((error: unknown) => (end = String(error)));
  await settle();
  mock.timers.tick(60_000);
  await stalled;
  assert.match(end, /no more bytes/);
  assert.ok(isCancelled, "the request goes on");
  mock.timers.reset();
});

test("a link to an object, a room or a level that is gone says so", () => {
  const box = { centre_m: [1, 2, 0], size_m: [1, 1, 1], yaw_rad: 0 };
  const data = {
    level: "main", things: [{ id: "sofa-1", ...box }], rooms: [{ id: "1", polygon_m: [[0, 0], [1, 0], [1, 1]] }],
    robotRooms: [{ id: "17", centre_m: [1, 1], area_m2: 4 }],
  } as unknown as HomeData;
  for (const [at, told] of [
    ["object.sofa-1", null], ["room.1", null], ["room.17", null],
    ["object.sofa-9", "The object of this link is no longer in the map."], ["room.9", "The room of this link is no longer in the map."],
  ] as const) {
    const [query, looks] = [new URLSearchParams({ at }), new Looks()];
    read(query, looks);
    assert.equal(deselectMissing(query, data, looks), told);
    assert.equal(looks.selected === null, told !== null, "what is gone stays selected");
  }
  for (const [level, told] of [["main", null], ["upper", "The level “Upper” of this link is no longer in this home."]] as const) {
    assert.equal(deselectMissing(new URLSearchParams({ level }), data, new Looks()), told);
  }
});

test("a view is read as it is written", () => {
  const looks = new Looks();
  looks.change((looks) => {
    looks.view = "2d";
    looks.colouring = "class";
    looks.clips = "ambiguous";
    looks.cut_m = 1.25;
    looks.layers.delete("lidar");
    looks.hiddenClasses.add("wall");
    looks.hiddenClips.add("01a1f766-7a97-7747-9dbb-391e0eeccb64");
    looks.selected = { kind: "room", id: "upper~room-1" };
  });
  const framing: Framing = {
    from: { eye_m: [1, -2.5, 3], target_m: [0, 0, 0.25] }, part: { min: [-1.25, 0], max: [3.5, 2] },
  };
  const query = new URLSearchParams(written(looks, "upper", framing).toString());
  const again = new Looks();
  assert.deepEqual(read(query, again), framing);
  assert.deepEqual([written(again, "upper", framing).toString(), again.clips], [query.toString(), "ambiguous"]);
  assert.deepEqual([...again.hiddenClips], [...looks.hiddenClips]);
  const nothing = { from: null, part: null };
  assert.equal(written(again, null, nothing).toString(), written(looks, null, nothing).toString());
  assert.deepEqual([written(looks, "upper", nothing).get("level"), written(looks, null, nothing).get("level")], ["upper", null]);
  assert.deepEqual(read(new URLSearchParams("part=1_2_3&from=1_2_x_4_5_6"), again), nothing);
  read(new URLSearchParams("clips=nonsense"), again);
  assert.equal(again.clips, "ambiguous");
  for (const query of ["", "view=4d&colour=x&layers=&cut=-1&at=thing.x&from=1_2", "from=a_b_c_d_e_f&cut=NaN"]) {
    const untouched = new Looks();
    assert.deepEqual(read(new URLSearchParams(query), untouched), nothing, query);
    assert.deepEqual([untouched.view, untouched.colouring, untouched.selected, untouched.cut_m], ["3d", "colour", null, null]);
  }
});

test("a home without colour is shown by class until a coloured point comes", () => {
  const cloud = new Cloud(3, true);
  const looks = new Looks();
  const add = (at: number, tint: number[]) => {
    const points = emptyPoints(tint.length / 4);
    points.tint.set(tint);
    cloud.add(at, points);
    looks.noteColour(cloud.hasColour);
  };
  // The number of views is no colour.
  add(0, [0, 0, 0, 9]);
  assert.deepEqual([looks.colouring, looks.colourings], ["class", ["class", "clip", "probability"]]);
  assert.match(looks.reasonAgainst("colour") ?? "", /colour/);
  // The surface has neither clips nor, here, colours.
  looks.change((looks) => [looks.colouring, looks.body] = ["clip", "surface"]);
  assert.deepEqual([looks.colouring, looks.colourings], ["class", ["class"]]);
  add(1, [0, 0, 0, 1, 0, 5, 0, 1]);
  assert.deepEqual([looks.colouring, looks.reasonAgainst("colour")], ["colour", null]);
});

test("rooms without a name are numbered within their level", () => {
  assert.equal(roomName({ name: null, id: "room-2" }), "Room 2");
  assert.equal(roomName({ name: null, id: "upper~room-1" }), "Room 1");
  assert.equal(roomName({ name: "Kitchen", id: "upper~room-1" }), "Kitchen");
  assert.equal(withoutLevel("upper~sofa-1"), "sofa-1");
});

test("a measurement tells its state", () => {
  assert.equal(progress([], null, "Tap two points."), "Tap two points.");
  assert.equal(progress([], [1, 2, 0], "Tap two points."), "Tap two points. Enter takes x 1.00 m, y 2.00 m.");
  assert.equal(progress([[0, 0, 0]], null, ""), "Tap or click the second point.");
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
