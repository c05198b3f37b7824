import "./dom.ts";
import assert from "node:assert/strict";
import { afterEach, test } from "node:test";
import { resumed } from "../src/cloud/resume.ts";

const real = { fetch: globalThis.fetch };
afterEach(() => void Object.assign(globalThis, real));

/** A body of some bytes that breaks, or ends. */
function body(bytes: number[], breaks: boolean): ReadableStream<Uint8Array> {
  let isSent = false;
  return new ReadableStream({
    pull: (stream) => {
      if (!isSent && bytes.length > 0) stream.enqueue(new Uint8Array(bytes));
      else if (breaks) stream.error(new Error("lost"));
      else stream.close();
      isSent = true;
    },
  });
}

/** Reads a file whose later requests get these answers; returns its bytes and the ranges that were asked for. */
async function read(first: Response, ...later: (() => Response)[]) {
  const asked: string[] = [];
  globalThis.fetch = async (_, options) => {
    const headers = new Headers(options?.headers);
    asked.push(`${headers.get("range")} ${headers.get("if-range")}`);
    return later.shift()?.() ?? Promise.reject(new Error("lost"));
  };
  const [got, online]: [number[], ReturnType<typeof setInterval>] = [[], setInterval(() => dispatchEvent(new Event("online")), 1)];
  try {
    for await (const piece of resumed(first, new AbortController().signal)) got.push(...piece);
    return { got, asked };
  } catch {
    return { got: null, asked };
  } finally {
    clearInterval(online);
  }
}

const begun = (bytes: number[], headers: Record<string, string> = { etag: 'W/"a"' }) => new Response(body(bytes, true), { headers });
const rest = (bytes: number[], from: number, breaks = false) => () =>
  new Response(body(bytes, breaks), { status: 206, headers: { "content-range": `bytes ${from}-5/6` } });

test("the rest of a broken file is asked for, and nothing of it twice", async () => {
  const found = await read(begun([0, 1, 2]), () => new Response("", { status: 503 }), rest([3], 3, true), rest([4, 5], 4));
  assert.deepEqual(found, { got: [0, 1, 2, 3, 4, 5], asked: ['bytes=3- "a"', 'bytes=3- "a"', 'bytes=4- "a"'] });
});

test("another file is not joined to the begun one", async () => {
  for (const other of [() => new Response("other"), () => new Response("", { status: 401 }), rest([9], 0)]) {
    const { got, asked } = await read(begun([0, 1, 2]), other);
    assert.deepEqual([got, asked.length], [null, 1]);
  }
  assert.deepEqual((await read(begun([0, 1, 2], {}))).asked, [], "a file without a tag may be another one");
  assert.equal((await read(begun([0]))).asked.length, 5, "a lost service is asked for ever");
});
