import { until } from "./dom.ts";
import assert from "node:assert/strict";
import { afterEach, test } from "node:test";
import type { HomeData } from "../src/home/data.ts";
import { Looks } from "../src/home/looks.ts";
import { HomeSurface } from "../src/home/surface.ts";

const real = { fetch: globalThis.fetch };
afterEach(() => void Object.assign(globalThis, real));

/** A GLB without triangles (glTF 2.0, section 4.4). */
function emptyGlb(): Uint8Array<ArrayBuffer> {
  const json = new TextEncoder().encode(JSON.stringify({ asset: { version: "2.0" }, scene: 0, scenes: [{}] }).padEnd(56));
  const bytes = new Uint8Array(20 + json.length);
  const header = new DataView(bytes.buffer);
  [0x46546c67, 2, bytes.length, json.length, 0x4e4f534a].forEach((value, i) => header.setUint32(4 * i, value, true));
  bytes.set(json, 20);
  return bytes;
}

test("a surface whose connection broke is loaded again by itself, and a refused one is told", async () => {
  const glb = emptyGlb();
  const broken = (headers: Record<string, string> = {}) => {
    let pulls = 0;
    return new Response(new ReadableStream({ pull: (stream) => (pulls++ ? stream.error(new Error("lost")) : stream.enqueue(glb.slice(0, 30))) }), { headers });
  };
  const rest = () => new Response(glb.slice(30), { status: 206, headers: { "content-range": `bytes 30-${glb.length - 1}/${glb.length}` } });
  const whole = () => new Response(glb);
  const refused = (status: number) => () => new Response("", { status });
  const data = { home: { id: "h" }, level: "main", map: { revision: 1, created_at: "", info: { points: 1 } } } as unknown as HomeData;
  const looks = Object.assign(new Looks(), { body: "surface" });
  const online = setInterval(() => dispatchEvent(new Event("online")), 1);
  for (const [answers, isShown] of [
    [[() => Promise.reject(new TypeError("lost")), refused(502), broken, whole], true],
    [[() => broken({ etag: '"a"' }), rest], true], [[refused(404)], false],
  ] as const) {
    const page = new AbortController();
    const [left, failures]: [(() => Response | Promise<Response>)[], unknown[]] = [[...answers], []];
    globalThis.fetch = async () => (left.shift() ?? refused(418))();
    const surface = new HomeSurface(() => {}, () => {}, (error) => failures.push(error), page.signal);
    surface.update(data, looks);
    await until(() => surface.shown !== null || failures.length > 0);
    assert.deepEqual([surface.shown !== null, left.length, failures.length], [isShown, 0, isShown ? 0 : 1], String(failures));
    page.abort();
  }
  clearInterval(online);
});
