import { until } from "./dom.ts";
import assert from "node:assert/strict";
import { afterEach, test } from "node:test";
import { Refusal } from "../src/api.ts";
import { inverse } from "../src/frames.ts";
import { boxBelow, isOfPreviousLidar, lidarBelow } from "../src/home/below.ts";
import { HomeData } from "../src/home/data.ts";
import { type Ink, LevelPicture } from "../src/home/picture.ts";
import { turned } from "../src/plan/view.ts";
import type { LidarMap, PictureFrame } from "../src/types.ts";

const never = new AbortController().signal;
const real = { fetch: globalThis.fetch };
afterEach(() => void Object.assign(globalThis, real));

/** Pictures that arrive when a test says so. */
function pictures() {
  const [open, shown, revoked]: [Map<string, (isThere: boolean | Error) => void>, (string | null)[], string[]] = [new Map(), [], []];
  const failures: unknown[] = [];
  const picture = new LevelPicture({
    load: (level: string, ink: Ink) => new Promise((resolve, reject) => {
      const address = `${level} ${ink}`;
      open.set(address, (isThere) => (isThere === true ? resolve({ canvas: {} as HTMLCanvasElement, address }) : reject(isThere || new Error("lost"))));
    }),
    show: (picture) => void shown.push(picture && `${picture.address} at ${picture.frame.px_per_m}${picture.at.x_m ? `, ${picture.at.x_m} m` : ""}`),
    onFailed: (error) => void failures.push(error),
    revoke: (address) => void revoked.push(address),
  }, never);
  const lidar = (revision: number, x_m = 0) =>
    ({ lidar: { revision, image: { px_per_m: revision } as PictureFrame }, at: { x_m, y_m: 0, yaw_rad: 0 } });
  const arrive = async (address: string, isThere: boolean | Error = true) => {
    open.get(address)?.(isThere);
    open.delete(address);
    await new Promise((resolve) => setImmediate(resolve));
  };
  return { picture, lidar, arrive, open, shown, revoked, failures };
}

test("the picture of another level goes at once, and one that comes late is dropped", async () => {
  const { picture, lidar, arrive, shown, revoked } = pictures();
  picture.update("main", lidar(1), "light");
  await arrive("main light");
  picture.update("upper", lidar(2), "light");
  assert.deepEqual(shown, ["main light at 1", null]);
  picture.update("main", lidar(1), "light");
  await arrive("upper light");
  assert.equal(shown.length, 2, "the picture of the level before is shown");
  await arrive("main light");
  assert.deepEqual(shown.at(-1), "main light at 1");
  picture.update("attic", null, "light");
  assert.deepEqual([shown.at(-1), revoked], [null, ["main light", "upper light", "main light"]]);
});

test("a newer picture of one level replaces the earlier one, which stays until then", async () => {
  const { picture, lidar, arrive, open, shown, revoked } = pictures();
  picture.update("main", lidar(1), "light");
  await arrive("main light");
  picture.update("main", lidar(1), "dark");
  picture.update("main", lidar(1), "dark");
  assert.deepEqual([shown.length, open.size], [1, 1]);
  await arrive("main dark");
  assert.deepEqual([shown.at(-1), revoked], ["main dark at 1", ["main light"]]);
});

test("after a new LiDAR map the picture of the earlier one stays, or the new one is drawn at its place", async () => {
  const { picture, lidar, arrive, shown } = pictures();
  picture.update("main", lidar(1), "light", 1);
  await arrive("main light");
  // The place of the new one is not known.
  for (const kept of [1, 1]) picture.update("main", null, "light", kept);
  assert.deepEqual(shown, ["main light at 1"]);
  picture.update("main", lidar(2, 5), "light", 1);
  await arrive("main light");
  // The home's map is rebuilt.
  picture.update("main", lidar(2), "light", 2);
  await arrive("main light");
  assert.deepEqual(shown.slice(1), ["main light at 2, 5 m", "main light at 2"]);
  picture.update("main", null, "light", 1);
  assert.equal(shown.at(-1), null, "the picture of another frame stays");
});

test("a picture that fails is tried again by the next update", async () => {
  const { picture, lidar, arrive, open, shown, failures } = pictures();
  picture.update("main", lidar(1), "light");
  await arrive("main light", false);
  assert.equal(failures.length, 1);
  picture.update("main", lidar(1), "light");
  assert.equal(open.size, 1);
  await arrive("main light");
  assert.deepEqual(shown, ["main light at 1"]);
});

test("a picture whose connection broke is loaded again without a word", async () => {
  const { picture, lidar, arrive, open, shown, failures } = pictures();
  picture.update("main", lidar(1), "light");
  await arrive("main light", new Refusal(0, "lost"));
  assert.equal(open.size, 0);
  // Ends the pause.
  dispatchEvent(new Event("online"));
  await until(() => open.size === 1);
  await arrive("main light");
  assert.deepEqual([shown, failures], [["main light at 1"], []]);
});

/** A home with two levels; `hold` holds the objects back until the test lets them go. */
function twoLevels() {
  const levels = ["main", "upper"];
  const thing = (level: string, name: string) => ({ id: level === "main" ? name : `${level}~${name}`, level, class: name });
  const service = {
    revision: 1, objects: [thing("main", "sofa-1"), thing("main", "bed-1"), thing("upper", "desk-1")], hold: null as Promise<void> | null, readings: 0,
  };
  const answers: Record<string, () => unknown> = {
    "/v1/homes/h": () => ({ id: "h", name: null }),
    "/v1/classes": () => ({ classes: [] }),
    "/v1/homes/h/lidar-maps": () => ({ items: levels.map((level, i) => ({ level, revision: i + 1 })) }),
    "/v1/homes/h/map": () => ({
      revision: service.revision, created_at: "", clips: [], info: { points: 5 },
      levels: levels.map((level) => ({ level, info: { points: level === "main" ? 3 : 2 } })),
    }),
    "/v1/homes/h/map/rooms": () => ({ rooms: levels.map((level) => ({ id: `${level}~room-1`, level })) }),
    "/v1/homes/h/map/objects": () => ({ objects: service.objects }),
    "/v1/homes/h/map/corrections": () => ({ objects: [{ id: "sofa-1", hidden: true }], rooms: [] }),
  };
  globalThis.fetch = async (path) => {
    const [address = ""] = String(path).split("?");
    const body = JSON.stringify(answers[address]?.() ?? (address.endsWith("/clips") ? { items: [], next: null } : null));
    if (address.endsWith("/objects")) {
      service.readings++;
      await service.hold;
    }
    return new Response(body);
  };
  const words = ({ level, lidar, map, rooms, things }: HomeData) =>
    [level, lidar?.revision, map?.info.points, rooms.length, things.map(({ id }) => id)];
  return { service, words };
}

test("another level has nothing of the level before", async () => {
  const { service, words } = twoLevels();
  const data = await HomeData.load("h", "main", never);
  assert.deepEqual(words(data), ["main", 1, 3, 1, ["sofa-1", "bed-1"]]);
  data.showLevel("upper");
  assert.deepEqual(words(data), ["upper", 2, 2, 0, []]);
  await data.refresh(never);
  assert.deepEqual(words(data), ["upper", 2, 2, 1, ["upper~desk-1"]]);
  // The level changes while the objects of the other one are on their way.
  let letGo = () => {};
  data.showLevel("main");
  service.hold = new Promise((resolve) => (letGo = resolve));
  const { readings } = service;
  const late = data.refresh(never);
  await until(() => service.readings > readings);
  data.showLevel("upper");
  letGo();
  await late;
  assert.deepEqual(words(data), ["upper", 2, 2, 0, []]);
});

test("a removed object goes at once, and stays away until the map is without it", async () => {
  const { service, words } = twoLevels();
  const data = await HomeData.load("h", "main", never);
  const [sofa] = data.things;
  assert.ok(sofa);
  const before = data.drawn;
  data.remove(sofa);
  assert.deepEqual(words(data).at(-1), ["bed-1"]);
  assert.notEqual(data.drawn, before, "the picture keeps the object");
  // A map that was begun before the removal.
  service.revision = 2;
  await data.refresh(never);
  assert.deepEqual(words(data).at(-1), ["bed-1"]);
  data.bringBack("sofa-1");
  assert.deepEqual(words(data).at(-1), ["bed-1", "sofa-1"]);
  data.remove(sofa);
  service.objects = service.objects.filter(({ id }) => id !== "sofa-1");
  service.revision = 3;
  await data.refresh(never);
  // Brought back by somebody else: the map has it again.
  service.objects = [...service.objects, { id: "sofa-1", level: "main", class: "sofa-1" }];
  service.revision = 4;
  await data.refresh(never);
  assert.deepEqual(words(data).at(-1), ["bed-1", "sofa-1"]);
});

test("a new LiDAR map is drawn where it lies in the frame of the home's map", () => {
  const below = (revision: number, x_m: number | null, points = 9, replaced = 1) => {
    const from_earlier = x_m === null ? null : { revision: replaced, map_from_earlier: { x_m, y_m: 0, yaw_rad: 0 } };
    const map = { levels: [{ level: "main", lidar_map_revision: 1, info: { points } }] };
    const data = { level: "main", lidar: { revision, from_earlier }, map } as unknown as HomeData;
    const found = lidarBelow(data);
    return [found && 0 + found.at.x_m, isOfPreviousLidar(data)];
  };
  assert.deepEqual(below(1, null), [0, false]);
  assert.deepEqual(below(2, 5), [-5, true]);
  assert.deepEqual(below(2, null), [null, true], "the maps do not tell the frame");
  assert.deepEqual(below(2, 0.02), [-0.02, true], "the robot kept its frame, nearly");
  assert.deepEqual(below(3, 0.02, 9, 2), [null, true], "the frame of the revision between is not known");
  assert.deepEqual(below(2, 5, 0), [0, false], "there are no points yet");
});

test("a clip that the map does not have yet is drawn where it lies in the frame of the map", async () => {
  const at = (x_m: number) => ({ level: "main", map_from_clip: { x_m, y_m: 0, yaw_rad: 0 } });
  const clips = [{ id: "old", state: "aligned", alignment: at(7) }, { id: "new", state: "aligned", alignment: at(8) }, { id: "chosen", choice: at(9) }];
  const lidar = { level: "main", revision: 2, from_earlier: { revision: 1, map_from_earlier: { x_m: 5, y_m: 0, yaw_rad: 0 } } as object | null };
  const level = { level: "main", lidar_map_revision: 1, info: { points: 9 } };
  const answers: Record<string, () => object> = {
    "": () => ({ id: "h" }), "/lidar-maps": () => ({ items: [lidar] }), "/clips": () => ({ items: clips, next: null }),
    "/map": () => ({ revision: 1, created_at: "", clips: [{ clip: "old", ...at(2) }], info: {}, levels: [level] }),
    "/map/rooms": () => ({ rooms: [] }), "/map/objects": () => ({ objects: [] }), "/map/coverage": () => ({}),
  };
  globalThis.fetch = async (path) => {
    const [address = ""] = String(path).replace("/v1/homes/h", "").split("?");
    return new Response(JSON.stringify(answers[address]?.() ?? { classes: [] }));
  };
  const data = await HomeData.load("h", "main", never);
  const places = () => data.clips.map((clip) => data.poseOf(clip)?.x_m ?? null);
  assert.deepEqual(places(), [2, 3, 4]);
  lidar.from_earlier = null;
  await data.refresh(never);
  assert.deepEqual(places(), [2, null, null], "the frame is not known");
  level.lidar_map_revision = 2;
  await data.refresh(never);
  assert.deepEqual(places(), [2, 8, 9]);
});

test("the walls of a turned LiDAR map enclose the home's map", () => {
  const at = inverse({ x_m: 3, y_m: 1, yaw_rad: Math.PI / 2 });
  const info = { min_m: [0, 0], max_m: [4, 2] };
  const box = boxBelow({ lidar: { info } as unknown as LidarMap, at });
  const rounded = [...(box?.min ?? []), ...(box?.max ?? [])].map((value) => 0 + Math.round(100 * value) / 100);
  // (3, 1) of the new frame is the origin of the earlier one, whose x goes along the new y.
  assert.deepEqual(rounded, [-1, -1, 1, 3]);
  assert.equal(turned(at), "translate(-100.0,-300.0) rotate(90.000)");
});

test("camera paths whose connection broke are read again, each once", async () => {
  twoLevels();
  const data = await HomeData.load("h", null, never);
  data.clips = ["a", "b", "c"].map((id) => ({ id, alignment: {} })) as unknown as HomeData["clips"];
  const asked: string[] = [];
  globalThis.fetch = async (path) => {
    const [, clip = ""] = /clips\/(.)\/scan$/.exec(String(path)) ?? [];
    asked.push(clip);
    if (clip === "b" && asked.filter((one) => one === "b").length < 3) throw new TypeError("lost");
    return new Response("{}", { status: clip === "c" ? 404 : 200 });
  };
  const online = setInterval(() => dispatchEvent(new Event("online")), 1);
  let reads = 0;
  await data.readScans(never, () => reads++);
  clearInterval(online);
  assert.deepEqual([[...data.scans.values()], reads, asked.toSorted().join("")], [[{}, {}, null], 1, "abbbc"]);
  globalThis.fetch = async () => new Response("{}", { status: 401 });
  data.scans.clear();
  await assert.rejects(data.readScans(never, () => reads++), (error) => error instanceof Refusal && error.status === 401);
});
