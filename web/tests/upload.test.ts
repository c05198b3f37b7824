import "./dom.ts";
import assert from "node:assert/strict";
import { afterEach, beforeEach, mock, test } from "node:test";
import { Refusal } from "../src/api.ts";
import { isLoopback } from "../src/session.ts";
import { sentName } from "../src/upload/names.ts";
import { sendMap } from "../src/upload/map.ts";
import { mayTryAgain, pause, retryDelay_ms } from "../src/upload/retry.ts";
import { request } from "../src/upload/request.ts";
import { sendClip, type SentClip } from "../src/upload/tus.ts";
import { clipName } from "../src/words.ts";
import { type Answer, answerRequests, type Asked } from "./request.ts";

const PART_BYTES = 8 << 20;
const SIZE_BYTES = 2 * PART_BYTES + 5;

/** One upload of a service; `loses` names the requests whose connection breaks. */
class Service {
  readonly seen: string[] = [];
  metadata = "";
  offset = 0;
  state = "gone";
  problem: { status: number; detail: string } | null = null;
  loses: string[] = [];
  /** Bytes that arrive before the connection of a lost PATCH breaks. */
  arrives_bytes = 0;

  answer({ method, headers, bytes }: Asked): Answer {
    const at = `${method}${headers.has("upload-offset") ? ` ${headers.get("upload-offset")}` : ""}`;
    this.seen.push(at);
    const isLost = this.loses[0] === at;
    if (isLost) this.loses.shift();
    if (method === "POST") {
      this.metadata = headers.get("upload-metadata") ?? "";
      [this.offset, this.state] = [0, "arriving"];
      return isLost ? { status: 0 } : { status: 201, headers: { location: "/v1/uploads/u" } };
    }
    if (this.state === "gone" || this.state === "refused") return { status: 410, body: '{"detail":"gone"}' };
    if (method === "PATCH") {
      if (Number(headers.get("upload-offset")) !== this.offset) return { status: 409, body: "{}" };
      this.offset += isLost ? this.arrives_bytes : bytes;
      if (this.offset === SIZE_BYTES) this.state = this.problem ? "refused" : "finished";
    }
    if (isLost) return { status: 0 };
    if (this.problem && this.state === "refused") return { status: this.problem.status, body: JSON.stringify(this.problem) };
    const clip: Record<string, string> = this.state === "finished" ? { "viola-clip": "/v1/homes/h/clips/c" } : {};
    return { status: 200, headers: { "upload-offset": String(this.offset), ...clip } };
  }
}

let service = new Service();

const real = { XMLHttpRequest: globalThis.XMLHttpRequest, fetch: globalThis.fetch };
beforeEach(() => {
  service = new Service();
  answerRequests((asked) => service.answer(asked));
  globalThis.fetch = () => Promise.resolve(service.state === "gone"
    ? new Response("{}", { status: 404 })
    : new Response(JSON.stringify({ state: service.state, problem: service.state === "refused" ? service.problem : null })));
});
afterEach(() => void Object.assign(globalThis, real));

const clipOf = (name = "kitchen.zip"): SentClip => ({
  home: "h", file: new File([new Uint8Array(SIZE_BYTES)], name), key: "k", path: null, acknowledged_bytes: 0,
});
const send = (clip: SentClip, onSent: (bytes: number) => void = () => {}) => sendClip(clip, onSent, new AbortController().signal);
const refusal = (status: number) => (error: unknown) => error instanceof Refusal && error.status === status;

test("a clip is sent in parts, with its home and its name", async () => {
  const sent: number[] = [];
  await send(clipOf("Küche.zip"), (bytes) => sent.push(bytes));
  assert.deepEqual(service.seen, ["POST", "HEAD", "PATCH 0", `PATCH ${PART_BYTES}`, `PATCH ${2 * PART_BYTES}`]);
  assert.deepEqual(sent, [0, PART_BYTES, 2 * PART_BYTES]);
  const pairs = service.metadata.split(",").map((pair) => pair.split(" "));
  assert.deepEqual(pairs.map(([name, value]) => [name, Buffer.from(value ?? "", "base64").toString()]),
    [["home", "h"], ["filename", "Küche.zip"], ["idempotency_key", "k"]]);
});

test("after a loss the upload resumes at the offset of the service", async () => {
  const clip = clipOf();
  service.loses = [`PATCH ${PART_BYTES}`];
  service.arrives_bytes = 1000;
  await assert.rejects(send(clip), refusal(0));
  service.seen.length = 0;
  await send(clip);
  assert.deepEqual(service.seen, ["HEAD", `PATCH ${PART_BYTES + 1000}`]);
});

test("two senders of one upload give way, and do not refuse each other's parts for ever", async () => {
  const clip = clipOf();
  await send(clip);
  [service.state, service.offset, service.seen.length] = ["arriving", 0, 0];
  let refusals = 0;
  answerRequests((asked) => (asked.method === "PATCH" && ++refusals < 100 ? { status: 409, body: "{}" } : service.answer(asked)));
  await assert.rejects(send(clip), (error: unknown) => retryDelay_ms(error, 1) !== null);
  assert.ok(refusals < 5, `the upload is tried ${refusals} times without a pause`);
});

test("a clip whose last answer was lost is not sent again", async () => {
  const clip = clipOf();
  service.loses = [`PATCH ${2 * PART_BYTES}`];
  service.arrives_bytes = 5;
  await assert.rejects(send(clip), refusal(0));
  service.seen.length = 0;
  await send(clip);
  assert.deepEqual(service.seen, ["HEAD"]);
});

test("the reason of a refusal is told, also if its answer was lost", async () => {
  const clip = clipOf();
  service.problem = { status: 415, detail: "No reader knows the file." };
  service.loses = [`PATCH ${2 * PART_BYTES}`];
  service.arrives_bytes = 5;
  await assert.rejects(send(clip), refusal(0));
  await assert.rejects(send(clip), (error: unknown) => refusal(415)(error) && (error as Error).message === "No reader knows the file.");
});

test("a map that is too large gets the advice for maps", async () => {
  const told = async (type: string) => {
    answerRequests(() => ({ status: 413, body: JSON.stringify({ type, title: "Too large", detail: "at most 64 MiB" }) }));
    const sent = sendMap("h", "main", new File(["x"], "map.pcd"), () => {}, new AbortController().signal);
    const error = await sent.then(() => null, (error: unknown) => error as Refusal);
    return [error?.status, error?.message, error?.detail];
  };
  const [status, message, detail] = await told("urn:viola:problem:body-too-large");
  assert.deepEqual([status, detail], [413, "at most 64 MiB"]);
  assert.match(String(message), /^The map is larger .* larger cells/);
  assert.deepEqual(await told("urn:viola:problem:unpacks-too-large"), [413, "at most 64 MiB", null]);
});

test("an upload that is gone begins again, after a pause", async () => {
  const clip = clipOf();
  service.loses = [`PATCH ${PART_BYTES}`];
  await assert.rejects(send(clip), refusal(0));
  service.state = "gone";
  await assert.rejects(send(clip), (error: unknown) => retryDelay_ms(error, 1) !== null);
  service.seen.length = 0;
  await send(clip);
  assert.deepEqual(service.seen.slice(0, 3), ["POST", "HEAD", "PATCH 0"]);
});

test("a request without an answer ends", async () => {
  answerRequests(() => null);
  mock.timers.enable({ apis: ["setTimeout"] });
  const { signal } = new AbortController();
  let end = "";
  const asked = request("PATCH", "/v1/uploads/u", { headers: {}, body: new Blob(["x"]), signal }).catch((error: unknown) => (end = String(error)));
  // The body is sent.
  await Promise.resolve();
  mock.timers.tick(180_000);
  await Promise.resolve();
  assert.equal(end, "", "the service may take three minutes");
  mock.timers.tick(60_000);
  await asked;
  assert.match(end, /The connection broke/);
  mock.timers.reset();
});

test("losses and faults are retried after growing delays, refusals are not", () => {
  const delays = [1, 2, 3, 20].map((failures) => retryDelay_ms(new Refusal(0, ""), failures));
  assert.deepEqual(delays, [1000, 2000, 4000, 30_000]);
  assert.equal(retryDelay_ms(new Refusal(503, "", 40), 1), 40_000);
  assert.equal(retryDelay_ms(new Refusal(429, "", 7), 1), 7000);
  for (const status of [400, 401, 404, 409, 413, 415, 422, 429, 507]) {
    assert.equal(retryDelay_ms(new Refusal(status, ""), 1), null, String(status));
  }
  assert.equal(retryDelay_ms(new Error("unreadable"), 1), null);
  // A fault that comes again and again ends; a lost connection does not.
  const faults = [1, 5, 6].map((failures) => retryDelay_ms(new Refusal(500, ""), failures) === null);
  assert.deepEqual(faults, [false, false, true]);
  assert.notEqual(retryDelay_ms(new Refusal(0, ""), 60), null);
  assert.ok([429, 507].every((status) => mayTryAgain(new Refusal(status, ""))));
  assert.ok([404, 415, 422].every((status) => !mayTryAgain(new Refusal(status, ""))));
});

test("a pause ends when the browser is online again", async () => {
  const events = new EventTarget();
  const { addEventListener, removeEventListener } = globalThis;
  Object.assign(globalThis, {
    addEventListener: events.addEventListener.bind(events), removeEventListener: events.removeEventListener.bind(events),
  });
  const waited = pause(60_000, new AbortController().signal);
  events.dispatchEvent(new Event("online"));
  await waited;
  const stop = new AbortController();
  const cancelled = pause(60_000, stop.signal);
  stop.abort();
  await cancelled;
  Object.assign(globalThis, { addEventListener, removeEventListener });
});

test("files and clips have names", () => {
  assert.equal(sentName({ name: "a\u0000\u0085b\n.zip" }), "ab.zip");
  assert.equal([...sentName({ name: "🏠".repeat(300) })].length, 255);
  assert.equal(clipName({ title: "Kitchen", file_name: "a.zip" }, 3), "Kitchen");
  assert.equal(clipName({ title: null, file_name: "a.zip" }, 3), "a.zip");
  assert.equal(clipName({ title: null, file_name: null }, 3), "Clip 3");
  assert.equal(clipName({ title: null, file_name: null }, 0), "Clip");
});

test("only names of this machine need no TLS", () => {
  for (const name of ["localhost", "a.localhost", "127.0.0.1", "127.1.2.3", "[::1]"]) assert.ok(isLoopback(name), name);
  for (const name of ["192.168.0.2", "127.example.com", "localhost.example.com", "viola", "[::2]"]) assert.ok(!isLoopback(name), name);
});
