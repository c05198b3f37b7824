// Fetches and reads points beside the page, so that it stays responsive.

import { delay_s, explanation, Refusal } from "../api.ts";
import type { Ask, Told } from "./messages.ts";
import { type Points, PlyStream } from "./ply.ts";

/** Pieces from the network are gathered to about this size: each piece costs the page a moment. */
const BATCH_BYTES = 1 << 20;

function tell(told: Told, transfer: Transferable[] = []): void {
  (self as unknown as { postMessage(message: Told, transfer: Transferable[]): void }).postMessage(told, transfer);
}

function tellPoints(at: number, points: Points): number {
  const count = points.position.length / 3;
  const buffers = [points.position, points.tint, points.kind, points.normal].map((array) => array.buffer);
  tell({ what: "points", at, points }, buffers as ArrayBuffer[]);
  return count;
}

function lost(): never {
  throw new Refusal(0, explanation(0, ""));
}

async function open(urls: string[]): Promise<Response | null> {
  for (const url of urls) {
    const answer = await fetch(url).catch(lost);
    if (answer.ok) return answer;
    if (answer.status === 404) continue;
    const message = explanation(answer.status, await answer.text().catch(lost));
    throw new Refusal(answer.status, message, delay_s(answer.headers.get("retry-after")));
  }
  return null;
}

function joined(chunks: Uint8Array[], size: number): Uint8Array {
  const bytes = new Uint8Array(size);
  let at = 0;
  for (const chunk of chunks) {
    bytes.set(chunk, at);
    at += chunk.length;
  }
  return bytes;
}

async function load(urls: string[]): Promise<void> {
  const answer = await open(urls);
  if (!answer?.body) return tell({ what: "nothing" });
  const stream = new PlyStream(true);
  const pieces = answer.body.getReader();
  let [at, size, begun] = [0, 0, false];
  let chunks: Uint8Array[] = [];
  for (;;) {
    const { value, done } = await pieces.read().catch(lost);
    if (value) {
      chunks.push(value);
      size += value.length;
    }
    if (done || size >= BATCH_BYTES || !begun) {
      const points = stream.push(joined(chunks, size));
      [chunks, size] = [[], 0];
      if (stream.header && !begun) {
        begun = true;
        tell({ what: "begin", count: stream.header.count, hasClips: stream.header.properties.has("clip") });
      }
      if (points) at += tellPoints(at, points);
    }
    if (done) break;
  }
  stream.end();
  tell({ what: "end" });
}

self.onmessage = (event: MessageEvent<Ask>) => {
  load(event.data.urls).catch((error: unknown) => {
    const { status, retryAfter_s } = error instanceof Refusal ? error : { status: null, retryAfter_s: null };
    tell({ what: "failed", status, retryAfter_s, message: error instanceof Error ? error.message : String(error) });
  });
};
