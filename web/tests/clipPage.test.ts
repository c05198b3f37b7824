import { fake, until } from "./dom.ts";
import assert from "node:assert/strict";
import { afterEach, test } from "node:test";
import { h } from "../src/dom.ts";

const real = { fetch: globalThis.fetch };
afterEach(() => void Object.assign(globalThis, real));

const streams: FakeStream[] = [];
class FakeStream extends EventTarget {
  constructor(readonly path: string) {
    super();
    streams.push(this);
  }
  close(): void {}
}
const matchMedia = () => Object.assign(new EventTarget(), { matches: false });
Object.assign(globalThis, { EventSource: FakeStream, matchMedia, createImageBitmap: () => {} });
Object.assign(document, { documentElement: { dataset: {} } });

const ID = "01a1f766-7abd-71fb-b5b7-3d59df71839d";

function clipOf(state: string, more: object = {}): object {
  const alternative = { level: "main", map_from_clip: { x_m: 0, y_m: 0, yaw_rad: 0 }, probability: 0.9, loss_m: 0.1, inliers: 0.8, free_space: null };
  const alignment = { ...alternative, alternatives: [alternative], hits: 9, seconds: {}, floor: null, labels: null, completion: null, coverage: null };
  const info = { frames: 1, frames_with_pose: 1, color_width: 0, layout: "polycam", notes: [] };
  return {
    home: "h", id: ID, state, reasons: [], job: null, choice: null, placement: null, last_answer: null, duplicate_of: null, title: null,
    file_name: null, recorded_at: null, created_at: "", size_bytes: 9, info, alignment, ...more,
  };
}

/** A service whose line is slow: no picture comes. `asked` has the paths of the requests. */
function slowService(more: object = {}) {
  const service = { state: "ambiguous", asked: [] as string[], clips: [] as object[] };
  const clip = () => clipOf(service.state, more);
  const answers: Record<string, () => object> = {
    "": () => ({ id: "h", name: null }), "/clips?limit=200": () => ({ items: [...service.clips, clip()], next: null }),
    [`/clips/${ID}`]: clip, [`/clips/${ID}/scan`]: () => ({ hits_m: [], cameras: [] }),
    "/lidar-maps": () => ({ items: [{ level: "main", image: {}, info: { min_m: [0, 0], max_m: [1, 1], charger: null } }] }),
  };
  globalThis.fetch = (path) => {
    const below = String(path).replace("/v1/homes/h", "");
    service.asked.push(below);
    const answer = answers[below];
    return answer ? Promise.resolve(new Response(JSON.stringify(answer()))) : new Promise(() => {});
  };
  return service;
}

async function shown() {
  const { showClip } = await import("../src/pages/clip.ts");
  const [main, page] = [h("main"), new AbortController()];
  await showClip({ main, crumbs: h("nav"), signal: page.signal, again: () => {} }, "h", ID);
  return { page, main: fake(main), text: () => fake(main).textContent };
}

test("a clip's page follows its home while the picture of the walls is on its way", async () => {
  const service = slowService();
  const pictures = () => service.asked.filter((path) => path.endsWith("image.png")).length;
  const { page, text } = await shown();
  await until(() => pictures() === 1 && streams.length === 1);
  assert.equal(streams[0]?.path, "/v1/homes/h/events");
  service.state = "queued";
  streams[0]?.dispatchEvent(new Event("change"));
  await until(() => text().includes("It waits for its turn."));
  assert.equal(pictures(), 1, "the same picture is asked for twice");
  page.abort();
});

test("a clip's page waits for the list of all clips only if it needs a number or the name of a twin", async () => {
  const twin = { id: "twin", title: "Kitchen", file_name: null };
  for (const [more, name, needsAll] of [
    [{ file_name: "hall.zip" }, /^hall\.zip/, false], [{ title: "Hall", file_name: "hall.zip" }, /^Hall/, false],
    [{}, /^Clip 2/, true], [{ file_name: "hall.zip", duplicate_of: "twin" }, /^hall\.zip.*Same recording as Kitchen/, true],
  ] as const) {
    const service = slowService(more);
    service.clips = [twin];
    const { page, text } = await shown();
    assert.match(text(), name);
    assert.equal(service.asked.some((path) => path.startsWith("/clips?")), needsAll, String(name));
    page.abort();
  }
});

test("the picture over the LiDAR map has one legend: its own, which its alternative text tells", async () => {
  slowService();
  const { page, main } = await shown();
  const figures = main.all("figure").filter((figure) => figure.all("img").some((image) => image.getAttribute("src")?.includes("overlay.png")));
  assert.equal(figures.length, 1);
  assert.deepEqual([figures[0]?.all("li").length, figures[0]?.all("ul").length], [0, 0]);
  assert.match(figures[0]?.textContent ?? "", /^The service's own answer over the LiDAR map\. Open the picture to read its legend\.$/);
  assert.match(figures[0]?.all("img")[0]?.getAttribute("alt") ?? "", /green .* red .* blue\.$/);
  page.abort();
});

test("a picture whose connection broke is loaded again, and one that the service does not have is left out", async () => {
  for (const [answers, stays] of [
    [[() => Promise.reject(new TypeError("lost")), () => new Response("", { status: 503 }), () => new Response("picture")], true],
    [[() => new Response("", { status: 404 })], false],
  ] as const) {
    slowService();
    const { page, main } = await shown();
    const image = main.all("img").find((image) => image.getAttribute("src")?.includes("overlay.png"));
    const [left, loaded]: [(() => Response | Promise<Response>)[], string[]] = [[...answers], []];
    globalThis.fetch = async (path) => (String(path).includes("overlay.png") && left.shift() || (() => new Promise<Response>(() => {})))();
    if (image) Object.assign(image, { setAttribute: (_: string, address: string) => loaded.push(address) });
    image?.dispatchEvent(new Event("error"));
    const isThere = () => main.all("img").includes(image ?? main);
    await until(() => (dispatchEvent(new Event("online")), stays ? loaded.length > 0 : !isThere()));
    assert.deepEqual([isThere(), loaded.length, left.length], [stays, stays ? 1 : 0, 0]);
    // A file that is no picture.
    image?.dispatchEvent(new Event("error"));
    assert.equal(isThere(), false);
    page.abort();
  }
});
