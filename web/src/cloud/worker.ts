// Fetches and reads points beside the page, so that it stays responsive.

import { file, lost, Refusal } from "../api.ts";
import type { Ask, Told } from "./messages.ts";
import { type Points, PlyStream } from "./ply.ts";
import { resumed } from "./resume.ts";

/** Pieces from the network are gathered to about this size: each piece costs the page a moment. */
const BATCH_BYTES = 1 << 20;

/** The page ends the worker with all that it does. */
const never = new AbortController().signal;

function tell(told: Told, transfer: Transferable[] = []): void {
  (self as unknown as { postMessage(message: Told, transfer: Transferable[]): void }).postMessage(told, transfer);
}

function tellPoints(at: number, points: Points): number {
  const count = points.position.length / 3;
  const buffers = [points.position, points.tint, points.kind, points.normal].map((array) => array.buffer);
  tell({ what: "points", at, points }, buffers as ArrayBuffer[]);
  return count;
}

async function open({ url, known }: Ask): Promise<Response | null> {
  try {
    return await file(url, known);
  } catch (error) {
    if (error instanceof Refusal && error.status === 404) return null;
    throw error;
  }
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

async function load(ask: Ask): Promise<void> {
  const answer = await open(ask);
  if (answer?.status === 304) return tell({ what: "same" });
  if (!answer?.body) return tell({ what: "nothing" });
  const stream = new PlyStream(true);
  const pieces = resumed(answer, never);
  let [at, size, begun] = [0, 0, false];
  let chunks: Uint8Array[] = [];
  for (;;) {
    const { value, done } = await pieces.next().catch(() => Promise.reject(lost()));
    if (value) {
      chunks.push(value);
      size += value.length;
    }
    if (done || size >= BATCH_BYTES || !begun) {
      const points = stream.push(joined(chunks, size));
      [chunks, size] = [[], 0];
      if (stream.header && !begun) {
        begun = true;
        const { count, properties } = stream.header;
        tell({ what: "begin", count, hasClips: properties.has("clip"), tag: answer.headers.get("etag") });
      }
      if (points) at += tellPoints(at, points);
    }
    if (done) break;
  }
  stream.end();
  tell({ what: "end" });
}

self.onmessage = (event: MessageEvent<Ask>) => {
  load(event.data).catch((error: unknown) => {
    const { status, retryAfter_s } = error instanceof Refusal ? error : { status: null, retryAfter_s: null };
    tell({ what: "failed", status, retryAfter_s, message: error instanceof Error ? error.message : String(error) });
  });
};
