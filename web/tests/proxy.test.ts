import "./dom.ts";
import assert from "node:assert/strict";
import { test } from "node:test";
import { Refusal } from "../src/api.ts";
import { sendClip, type SentClip } from "../src/upload/tus.ts";
import { type Answer, answerRequests } from "./request.ts";

const KIB = 1024;

/** A service behind a proxy that takes bodies of `limit_bytes`; the bodies of its PATCH requests are `bodies`. */
class Proxied {
  readonly bodies: number[] = [];
  offset = 0;

  constructor(private readonly limit_bytes: number, private readonly size_bytes: number, private readonly refusal: Answer) {
    answerRequests(({ method, bytes }) => {
      if (method === "POST") return { status: 201, headers: { location: "/v1/uploads/u" } };
      if (method === "PATCH") {
        this.bodies.push(bytes);
        if (bytes > this.limit_bytes) return this.refusal;
        this.offset += bytes;
      }
      const clip: Record<string, string> = this.offset === this.size_bytes ? { "viola-clip": "/v1/homes/h/clips/c" } : {};
      return { status: 200, headers: { "upload-offset": String(this.offset), ...clip } };
    });
  }
}

const OF_PROXY: Answer = { status: 413, body: "<html>413 Request Entity Too Large</html>" };

function clipOf(size_bytes: number): SentClip {
  const file = new File([new Uint8Array(size_bytes)], "kitchen.zip");
  return { home: "h", file, key: "k", path: null, acknowledged_bytes: 0 };
}

function send(size_bytes: number, clip = clipOf(size_bytes)): { sent: number[]; end: Promise<unknown> } {
  const sent: number[] = [];
  return { sent, end: sendClip(clip, (bytes) => sent.push(bytes), new AbortController().signal) };
}

// The tests of this file share the size that the page remembers, so they are in this order.

test("the service's own refusal of the size is told at once", async () => {
  const body = JSON.stringify({ type: "urn:viola:problem:too-many-pieces", detail: "at most 10 000" });
  const service = new Proxied(0, 3 * 1024 * KIB, { status: 413, body });
  await assert.rejects(send(3 * 1024 * KIB).end, (error) => error instanceof Refusal && error.message === "at most 10 000");
  assert.deepEqual(service.bodies, [3 * 1024 * KIB]);
});

test("on a slow line behind a proxy that forwards whole parts, a part that is lost twice becomes smaller", async () => {
  for (const status of [0, 504]) {
    const size_bytes = 5 * 1024 * KIB;
    const service = new Proxied(2 * 1024 * KIB, size_bytes, { status });
    const clip = clipOf(size_bytes);
    let tries = 1;
    while ((await send(size_bytes, clip).end.catch(() => null)) !== "stored") assert.ok(++tries < 9);
    assert.deepEqual(service.bodies.map((bytes) => bytes / KIB), [5120, 5120, 2560, 1280, 1280, 1280, 1280]);
  }
});

test("behind a proxy with a small limit the parts become smaller, also those of the next file", async () => {
  const size_bytes = 9 * 1024 * KIB;
  const service = new Proxied(1_000_000, size_bytes, OF_PROXY);
  const { sent, end } = send(size_bytes);
  assert.equal(await end, "stored");
  assert.deepEqual(service.bodies.map((bytes) => bytes / KIB), [8192, 4096, 2048, 1024, ...Array<number>(18).fill(512)]);
  assert.deepEqual(sent.slice(0, 6), [0, 0, 0, 0, 0, 512 * KIB], "the progress tells bytes that were refused");

  const next = new Proxied(1_000_000, 1024 * KIB, { status: 413, body: '{"message":"Request Too Long"}' });
  assert.equal(await send(1024 * KIB).end, "stored");
  assert.deepEqual(next.bodies.map((bytes) => bytes / KIB), [512, 512]);
});

test("a proxy that takes no part of 256 KiB is told", async () => {
  const service = new Proxied(1000, 1024 * KIB, OF_PROXY);
  await assert.rejects(send(1024 * KIB).end, (error) => error instanceof Refusal && /A proxy before the service/.test(error.message));
  assert.deepEqual(service.bodies.map((bytes) => bytes / KIB), [512, 256]);
});
