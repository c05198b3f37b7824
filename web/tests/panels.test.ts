import { body, fake, until } from "./dom.ts";
import assert from "node:assert/strict";
import { getEventListeners } from "node:events";
import { afterEach, test } from "node:test";
import { emptyPoints } from "../src/cloud/ply.ts";
import { load } from "../src/cloud/points.ts";
import { Compare } from "../src/home/compare.ts";
import type { HomeData } from "../src/home/data.ts";
import { otherFiles } from "../src/home/earlier.ts";
import { Measure } from "../src/home/measure.ts";
import { HomePoints } from "../src/home/points.ts";
import { Looks } from "../src/home/looks.ts";
import { Summary } from "../src/home/summary.ts";
import { states } from "../src/pages/homes.ts";
import type { LidarRevision } from "../src/types.ts";

const real = { fetch: globalThis.fetch };
afterEach(() => void Object.assign(globalThis, real));
const never = new AbortController().signal;

/** The panel of changes with a service that answers when a test says so. */
function compared() {
  const open = new Map<string, (answer: Response) => void>();
  globalThis.fetch = (path) => new Promise((resolve) => open.set(String(path).replace("/v1/homes/h/map/", ""), resolve));
  const answer = async (path: string, value: unknown) => {
    await until(() => open.has(path));
    open.get(path)?.(new Response(JSON.stringify(value), { status: value === null ? 503 : 200 }));
    open.delete(path);
  };
  const data = { home: { id: "h" }, map: { revision: 3 }, level: "main", described: "3 main", rooms: [] };
  const panel = new Compare(data as unknown as HomeData, () => {}, never);
  body.replaceChildren(fake(panel.element));
  const revisions = () => answer("revisions?limit=50", { items: [3, 2, 1].map((revision) => ({ revision, created_at: "" })), next: null });
  const changes = (from: number, name: string) => answer(`changes?from=${from}&to=3`, {
    added: [{ id: name, name, level: "main", room: null }], discovered: [], found_again: [], moved: [], gone: [], lost: [],
  });
  return { panel, data, open, answer, revisions, changes, text: () => fake(panel.element).textContent };
}

test("a comparison that comes late does not replace the chosen one", async () => {
  const { panel, revisions, changes, text } = compared();
  const drawn = panel.draw();
  await revisions();
  const [from] = fake(panel.element).all("select");
  await until(() => from?.value === "2");
  if (from) from.value = "1";
  from?.dispatchEvent(new Event("change"));
  await changes(1, "Sofa");
  await until(() => text().includes("Sofa"));
  await changes(2, "Table");
  await drawn;
  assert.ok(text().includes("Sofa") && !text().includes("Table"), text());
});

test("changes are those since the newest earlier map until a person chooses one, and keep the focus", async () => {
  const { panel, data, answer, revisions, changes, text } = compared();
  const first = panel.draw();
  await revisions();
  await changes(2, "Sofa");
  await first;
  const row = () => fake(panel.element).all("button")[0];
  row()?.focus();
  const next = async (revision: number, from: number, name: string) => {
    Object.assign(data, { map: { revision }, described: `${revision} main` });
    const drawn = panel.draw();
    const all = Array.from({ length: revision }, (_, i) => ({ revision: revision - i, created_at: "" }));
    await answer("revisions?limit=50", { items: all, next: null });
    await answer(`changes?from=${from}&to=${revision}`, {
      added: ["Sofa", name].map((id) => ({ id, name: id, level: "main", room: null })), discovered: [], found_again: [], moved: [], gone: [], lost: [],
    });
    await drawn;
    assert.ok(text().includes(name), text());
  };
  await next(4, 3, "Table");
  assert.equal(document.activeElement, row(), "the row lost the focus");
  const [from] = fake(panel.element).all("select");
  if (from) from.value = "1";
  from?.dispatchEvent(new Event("change"));
  await answer("changes?from=1&to=4", { added: [], discovered: [], found_again: [], moved: [], gone: [], lost: [] });
  await next(5, 1, "Lamp");
});

test("an object that was known before is not worded as seen for the first time", async () => {
  const { panel, data, answer, revisions, text } = compared();
  const drawn = panel.draw();
  await revisions();
  const thing = (name: string) => ({ id: name, name, level: "main", room: null });
  await answer("changes?from=2&to=3", {
    added: [], discovered: [thing("Bed")], found_again: [thing("Sofa")], moved: [], gone: [], lost: [],
  });
  await drawn;
  assert.match(text(), /1 object seen for the first time.*Bed.*1 object found again.*Sofa/);
  data.described = "3 main, described again";
  const again = panel.draw();
  await revisions();
  await answer("changes?from=2&to=3", { added: [], discovered: [], found_again: [thing("Sofa")], moved: [], gone: [], lost: [] });
  await again;
  assert.match(text(), /1 object found again.*Sofa/);
});

test("changes are compared again on another level, and after an error", async () => {
  const { panel, data, open, answer, revisions, changes, text } = compared();
  const failed = panel.draw();
  await answer("revisions?limit=50", null);
  await failed;
  assert.match(text(), /status 503/);
  const drawn = panel.draw();
  await revisions();
  await changes(2, "Sofa");
  await drawn;
  await panel.draw();
  assert.equal(open.size, 0, "an unchanged map was asked for again");
  const isOff = () => fake(panel.element).all("button").map((row) => row.getAttribute("disabled"));
  assert.deepEqual(isOff(), [null]);
  data.level = "upper";
  const again = panel.draw();
  await revisions();
  await changes(2, "Sofa");
  await again;
  assert.deepEqual(isOff(), [""]);
});

test("no point is measured while points of the map are missing", () => {
  const measure = new Measure(never);
  const text = () => fake(measure.element).textContent;
  measure.button.dispatchEvent(new Event("click"));
  measure.isReady = false;
  assert.match(text(), /^Measuring waits until all points are loaded/);
  assert.ok(measure.take([1, 2, 0]), "the click selects something");
  assert.deepEqual(measure.ends, []);
  measure.isReady = true;
  assert.match(text(), /^Tap or click two points\.Done$/);
  measure.take([1, 2, 0]);
  assert.deepEqual(measure.ends, [[1, 2, 0]]);
});

/** The points of a home, with workers that answer when a test says so. */
function loadedPoints() {
  const workers: { onmessage: (event: { data: unknown }) => void; onerror: () => void; known: string | null }[] = [];
  class FakeWorker {
    onmessage = () => {};
    onerror = () => {};
    known: string | null = null;
    postMessage({ known }: { known: string | null }): void {
      this.known = known;
      workers.push(this);
    }
    terminate(): void {}
  }
  Object.assign(globalThis, { Worker: FakeWorker, POINTS_WORKER: "" });
  const told = (worker: number, ...messages: unknown[]) => messages.forEach((data) => workers[worker]?.onmessage({ data }));
  const failures: string[] = [];
  const [nothing, onFailed] = [() => {}, (text: string) => void failures.push(text)];
  const points = new HomePoints({ onShown: nothing, onGrown: nothing, onStatus: nothing, onFailed }, never);
  const mapOf = (revision: number) =>
    ({ revision, created_at: "", clips: [{ clip: `clip of ${revision}` }], info: { points: 2, voxel_m: 0.03 } });
  const dataOf = (revision: number, level = "main") => ({ home: { id: "h" }, level, map: mapOf(revision) }) as unknown as HomeData;
  return { workers, told, failures, points, dataOf };
}
const begin = { what: "begin", count: 2, hasClips: true, tag: '"a"' };
const point = (at: number) => ({ what: "points", at, points: emptyPoints(1) });

test("the points of a map are kept if a later one has the same", () => {
  const { workers, told, points, dataOf } = loadedPoints();
  points.update(dataOf(1));
  told(0, begin, point(0));
  points.update(dataOf(2));
  assert.deepEqual(workers.map(({ known }) => known), [null, null], "a part of the points is not known as a whole");
  told(1, begin, point(0), point(1), { what: "end" });
  const cloud = points.shown?.cloud;
  points.update(dataOf(3));
  assert.equal(workers[2]?.known, '"a"');
  told(2, { what: "same" });
  assert.deepEqual([points.shown?.map_revision, points.shown?.cloud === cloud, points.isComplete], [3, true, true]);
  points.update(dataOf(3));
  assert.equal(workers.length, 3, "the same map was asked for again");
});

test("the earlier points stay until those of the new map are complete", async () => {
  const { workers, told, failures, points, dataOf } = loadedPoints();
  points.update(dataOf(1));
  assert.equal(points.isComplete, false);
  told(0, begin, point(0));
  assert.deepEqual([points.shown?.map_revision, points.isComplete], [1, false], "the first points are shown as they come");
  told(0, point(1), { what: "end" });
  assert.equal(points.isComplete, true);
  points.update(dataOf(2));
  told(1, begin, point(0));
  assert.deepEqual([points.shown?.clips, points.isComplete], [["clip of 1"], true]);
  told(1, point(1), { what: "end" });
  assert.deepEqual(points.shown?.clips, ["clip of 2"]);
  points.update(dataOf(3));
  told(2, begin, { what: "failed", message: "busy", status: 503, retryAfter_s: 600 });
  points.update(dataOf(3));
  assert.deepEqual([workers.length, points.shown?.map_revision, failures], [3, 2, []]);
  // The end of the pause.
  dispatchEvent(new Event("online"));
  await until(() => workers.length === 4);
  told(3, begin, { what: "failed", message: "damaged", status: null, retryAfter_s: null });
  assert.deepEqual([points.shown?.map_revision, failures], [2, ["The points: damaged"]]);
  points.update(dataOf(3));
  assert.equal(workers.length, 5, "the next change of the home does not try again");
  points.update(dataOf(3, "upper"));
  assert.equal(points.shown, null);
});

test("a tab of an earlier version, whose scripts the service has no longer, asks for a reload", async () => {
  for (const status of [404, 200]) {
    const { workers, failures, points, dataOf } = loadedPoints();
    globalThis.fetch = async () => new Response("", { status });
    points.update(dataOf(1));
    workers[0]?.onerror();
    await until(() => failures.length > 0);
    assert.match(failures.join(), /Reload the page/);
  }
});

test("a script that was lost on its way is asked for again", async () => {
  const { workers, failures, points, dataOf } = loadedPoints();
  globalThis.fetch = () => Promise.reject(new TypeError("lost"));
  points.update(dataOf(1));
  workers[0]?.onerror();
  await until(() => (dispatchEvent(new Event("online")), workers.length === 2));
  assert.deepEqual(failures, []);
});

test("a failed attempt leaves none of its points in memory", () => {
  const { told } = loadedPoints();
  const { signal } = new AbortController();
  const [nothing, ends] = [() => {}, [] as string[]];
  const arrival = { begun: nothing, grown: nothing, ended: () => void ends.push("ended"), nothing, failed: () => void ends.push("failed") };
  for (const end of [{ what: "failed", message: "lost", status: 0, retryAfter_s: null }, { what: "end" }]) {
    load("/points", arrival, signal);
    assert.equal(getEventListeners(signal, "abort").length, 1);
    told(ends.length, begin, point(0), end);
    assert.equal(getEventListeners(signal, "abort").length, 0, "the page keeps what the attempt loaded");
  }
  assert.deepEqual(ends, ["failed", "ended"]);
});

test("the figures of a level count its own clips, and say that the map is out of date", () => {
  const clips = ["main", "upper", "upper"].map((level) => ({ level }));
  for (const [state, end] of [["current", ""], ["due", " · being rebuilt"], ["failing", " · could not be rebuilt, the service tries again"]]) {
    const map = { revision: 2, state, clips, info: { points: 9 } };
    const data = { level: "main", map, lidar: null, coverage: null, clips: [] };
    assert.equal(new Summary(data as unknown as HomeData, new Looks()).figures.textContent, `Map 2 · 9 points · 1 clip${end}`);
  }
});

test("the figures say that the new LiDAR map appears later, if its place is not known", () => {
  const map = { revision: 2, state: "due", clips: [], info: { points: 9 }, levels: [{ level: "main", lidar_map_revision: 1, info: { points: 9 } }] };
  for (const [revision, from_earlier, isLater] of [
    [1, null, false], [2, null, true], [2, { revision: 1, map_from_earlier: { x_m: 5, y_m: 0, yaw_rad: 1 } }, false],
  ] as const) {
    const data = { level: "main", map, lidar: { revision, from_earlier }, coverage: null, clips: [] };
    const told = new Summary(data as unknown as HomeData, new Looks()).figures.textContent ?? "";
    assert.equal(told.includes("the new LiDAR map appears when the map is rebuilt"), isLater, told);
  }
});

test("a map that cannot be made is told in the list of homes, and by the home", () => {
  const clips_by_state = { uploaded: 0, queued: 0, aligning: 0, aligned: 2, ambiguous: 0, failed: 0 };
  for (const [map_state, badges, title] of [
    ["current", "2 placed", "The map is being made"], ["due", "2 placed", "The map is being made"],
    ["failing", "2 placedmap needs attention", "The map could not be made"],
  ] as const) {
    assert.equal(states({ clips_by_state, map_state }).textContent, badges);
    const clips = [{ id: "a", state: "aligned" }];
    const data = { home: { map_state }, level: "main", map: null, lidar: {}, coverage: null, clips, levelOf: () => "main" };
    const { empty } = new Summary(data as unknown as HomeData, new Looks());
    assert.ok(empty.textContent?.startsWith(title) && !empty.hidden, `${map_state}: ${empty.textContent}`);
  }
});

test("a home whose clips have no place is not told to film a level", () => {
  const clips = [{ id: "a", state: "ambiguous" }];
  for (const [placed, title] of [[[], "No map of the clips yet"], [[{ clip: "b", level: "upper" }], "No clip of the level “Main”"]] as const) {
    const map = { revision: 1, state: "current", clips: placed, info: { points: 0 } };
    const data = { home: { map_state: "current" }, level: "main", map, lidar: {}, coverage: null, clips, levelOf: () => null };
    const { empty } = new Summary(data as unknown as HomeData, new Looks());
    assert.ok(empty.textContent?.startsWith(title) && !empty.hidden, `${empty.textContent}`);
  }
});

test("a restored LiDAR map is no earlier map", () => {
  const revisions = ["a", "b", "a", "c", "b"].map((sha256, i) => ({ sha256, revision: 5 - i })) as LidarRevision[];
  assert.deepEqual(otherFiles(revisions).map(({ revision }) => revision), [4, 2]);
  assert.deepEqual(otherFiles([]), []);
});
