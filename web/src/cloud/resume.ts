// Reads large answers, whose whole time nobody knows. A lost connection continues the file: megabytes would never be complete on
// a network that breaks each minute.

import { pause, retryDelay_ms } from "../upload/retry.ts";
import { Refusal } from "../api.ts";

/** A connection that brings no byte for this time is lost. */
const STALLED_MS = 60_000;
/** Attempts in a row without a byte; then the whole file is asked for again. */
const MOST_ATTEMPTS = 5;

type Pieces = ReadableStreamDefaultReader<Uint8Array>;

/** The bytes of an answer to a GET. */
export async function bytesOf(answer: Response, signal: AbortSignal): Promise<ArrayBuffer> {
  const chunks: Uint8Array<ArrayBuffer>[] = [];
  for await (const piece of resumed(answer, signal)) chunks.push(new Uint8Array(piece));
  return new Blob(chunks).arrayBuffer();
}

/** The pieces of an answer to a GET. After a loss the rest of the same file is asked for; throws if none comes. */
export async function* resumed(answer: Response, signal: AbortSignal): AsyncGenerator<Uint8Array, undefined> {
  let pieces: Pieces | undefined = answer.body?.getReader();
  // A packed answer has a weak tag; a range is of the file as it is.
  const tag = answer.headers.get("etag")?.replace(/^W\//, "");
  let received_bytes = 0;
  while (pieces) {
    try {
      const { value, done } = await nextPiece(pieces);
      if (done) return;
      received_bytes += value.length;
      yield value;
    } catch (error) {
      if (!tag || received_bytes === 0) throw error;
      pieces = await restOf(answer.url, tag, received_bytes, signal);
    }
  }
}

/** The next piece of an answer, or its end; throws if neither comes in time. */
async function nextPiece(pieces: Pieces): Promise<ReadableStreamReadResult<Uint8Array>> {
  let timer: ReturnType<typeof setTimeout> | undefined;
  const stalled = new Promise<never>((_, reject) => {
    timer = setTimeout(() => reject(new Error("The connection brings no more bytes.")), STALLED_MS);
  });
  try {
    return await Promise.race([pieces.read(), stalled]);
  } catch (error) {
    pieces.cancel().catch(() => {});
    throw error;
  } finally {
    clearTimeout(timer);
  }
}

async function restOf(url: string, tag: string, from_bytes: number, signal: AbortSignal): Promise<Pieces> {
  for (let failures = 1; failures <= MOST_ATTEMPTS; failures++) {
    signal.throwIfAborted();
    await pause(retryDelay_ms(new Refusal(0, ""), failures) ?? 0, signal);
    const answer = await fetch(url, { signal, headers: { range: `bytes=${from_bytes}-`, "if-range": tag } }).catch(() => null);
    const isRest = answer?.status === 206 && answer.headers.get("content-range")?.startsWith(`bytes ${from_bytes}-`);
    if (isRest && answer.body) return answer.body.getReader();
    // Another file, or a refusal: the next request for the whole one tells which.
    await answer?.body?.cancel();
    if (answer && ![502, 503, 504].includes(answer.status)) break;
  }
  throw new Error("The rest of the file does not come.");
}
