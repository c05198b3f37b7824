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

function clipOf(state: string): object {
  const alternative = { level: "main", map_from_clip: { x_m: 0, y_m: 0, yaw_rad: 0 }, probability: 0.9, loss_m: 0.1, inliers: 0.8, free_space: null };
  const alignment = { ...alternative, alternatives: [alternative], hits: 9, seconds: {}, floor: null, labels: null, completion: null, coverage: null };
  const info = { frames: 1, frames_with_pose: 1, color_width: 0, layout: "polycam", notes: [] };
  return {
    home: "h", id: ID, state, reasons: [], job: null, choice: null, placement: null, last_answer: null, duplicate_of: null, title: null,
    file_name: null, recorded_at: null, created_at: "", size_bytes: 9, info, alignment,
  };
}

test("a clip's page follows its home while the picture of the walls is on its way", async () => {
  const { showClip } = await import("../src/pages/clip.ts");
  const service = { state: "ambiguous", pictures: 0 };
  const answers: Record<string, () => object> = {
    "": () => ({ id: "h", name: null }), "/clips?limit=200": () => ({ items: [clipOf(service.state)], next: null }),
    [`/clips/${ID}`]: () => clipOf(service.state), [`/clips/${ID}/scan`]: () => ({ hits_m: [], cameras: [] }),
    "/lidar-maps": () => ({ items: [{ level: "main", image: {}, info: { min_m: [0, 0], max_m: [1, 1], charger: null } }] }),
  };
  globalThis.fetch = (path) => {
    const answer = answers[String(path).replace("/v1/homes/h", "")];
    if (answer) return Promise.resolve(new Response(JSON.stringify(answer())));
    // The line is slow: the picture does not come.
    service.pictures++;
    return new Promise(() => {});
  };
  const [main, page] = [h("main"), new AbortController()];
  void showClip({ main, crumbs: h("nav"), signal: page.signal, again: () => {} }, "h", ID);
  await until(() => service.pictures === 1 && streams.length === 1);
  assert.equal(streams[0]?.path, "/v1/homes/h/events");
  service.state = "queued";
  streams[0]?.dispatchEvent(new Event("change"));
  await until(() => fake(main).textContent.includes("It waits for its turn."));
  assert.equal(service.pictures, 1, "the same picture is asked for twice");
  page.abort();
});
