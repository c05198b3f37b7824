// A home from its map to its clip's pose, by the generated client: `node build/tour.js BASE MAP CLIP [KEY]`.
import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { accepted, type Clip, Refused, viola } from "./client.js";

const [base, map, clip, key] = process.argv.slice(2);
if (base === undefined || map === undefined || clip === undefined) throw new Error("give BASE MAP CLIP [KEY]");
const api = viola(base, key);
const home = "typescript";
const octets = { headers: { "content-type": "application/octet-stream" } };
/** A clip needs seconds to minutes; a service without a worker never aligns it. */
const DEADLINE_MS = 600_000;

accepted(await api.PUT("/v1/homes/{home}", { params: { path: { home } }, body: { name: "Elm Street" } }));
const lidar = new Blob([await readFile(map)]);
const revision = accepted(
  await api.PUT("/v1/homes/{home}/lidar-map", { params: { path: { home } }, body: lidar, ...octets }),
);
assert.ok("revision" in revision);
assert.equal(revision.revision, 1);

// One key for each recording: a retry with it makes no second clip.
const recordingKey = crypto.randomUUID();
const added = accepted(
  await api.POST("/v1/homes/{home}/clips", {
    params: { path: { home }, header: { "Idempotency-Key": recordingKey } },
    body: new Blob([await readFile(clip)]),
    ...octets,
  }),
);
assert.ok("id" in added);
let now: Clip = added;
const begun_ms = performance.now();
while (now.state === "queued" || now.state === "aligning") {
  if (performance.now() - begun_ms > DEADLINE_MS) throw new Error(`the clip is still ${now.state} after ${DEADLINE_MS / 1000} s`);
  await new Promise((resolve) => setTimeout(resolve, 100));
  const path = { home, clip: added.id };
  now = accepted(await api.GET("/v1/homes/{home}/clips/{clip}", { params: { path } }));
}
// The feed comes in pages, the oldest first.
let isTold = false;
let page = accepted(await api.GET("/v1/changes", {}));
for (;;) {
  isTold ||= page.items.some((change) => change.kind === "clip" && change.clip === added.id);
  if (!page.more) break;
  page = accepted(await api.GET("/v1/changes", { params: { query: { after: page.next } } }));
}
assert.ok(isTold);

// A refusal has a type that programs can tell apart.
const nowhere = await api.GET("/v1/homes/{home}", { params: { path: { home: "nowhere" } } });
assert.throws(
  () => accepted(nowhere),
  (error) => error instanceof Refused && error.status === 404 && error.problem?.type === "urn:viola:problem:home-not-found",
);
console.log(JSON.stringify({ state: now.state, map_from_clip: now.alignment?.map_from_clip }));
