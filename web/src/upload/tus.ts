// Sends a clip in parts by tus 1.0. After a loss, the next attempt resumes at the offset of the service.

import { Refusal, refusalOf, upload } from "../api.ts";
import { type Begun, keepBegun } from "./begun.ts";
import { sentName } from "./names.ts";
import { request } from "./request.ts";
import { pause } from "./retry.ts";

/** Each part is durable when it is answered. */
const PART_BYTES = 8 << 20;
/** Parts become smaller where a proxy before the service does not take them, but not smaller than this. */
const LEAST_PART_BYTES = 256 << 10;
/** Parts of a file that the service takes. */
const MOST_PARTS = 10_000;
/** Pauses between the questions whether a complete file is stored: each is twice the one before. */
const FIRST_POLL_MS = 2000;
const LONGEST_POLL_MS = 30_000;
/** Statuses of a part that did not reach the service: a lost connection, and a proxy that gave up. */
const LOST = [0, 408, 502, 504];
/** Offsets that another request has moved, in one attempt. */
const MOST_CONFLICTS = 2;
const VERSION = { "tus-resumable": "1.0.0" };

/** Size of the parts that the proxy takes: the next file of this page goes through the same one. */
let most_part_bytes = PART_BYTES;

/** A clip that is sent; the service keeps its bytes between the attempts. */
export interface SentClip extends Begun {
  home: string;
  file: File;
  /** Bytes that the service has for sure. */
  acknowledged_bytes: number;
  /** Offset of the last part that was lost. */
  lost_at?: number;
  /** Size of the parts, if parts were lost again and again. */
  part_bytes?: number;
}

/** State of a clip whose bytes are all sent: the service has stored it, or still reads it. */
export type Sent = "stored" | "arrived";

/** Sends the rest of a clip. `onSent` gets the number of sent bytes. */
export async function sendClip(clip: SentClip, onSent: (bytes: number) => void, signal: AbortSignal): Promise<Sent> {
  if (!clip.path) {
    clip.path = await create(clip, signal);
    keepBegun(clip);
  }
  return (await sendRest(clip, clip.path, onSent, signal)) ?? lose(clip);
}

/** Waits while the service reads an arrived clip; returns when it is stored. Throws the reason of a refusal. */
export async function untilStored(clip: SentClip, signal: AbortSignal): Promise<void> {
  for (let wait_ms = FIRST_POLL_MS; ; wait_ms = Math.min(2 * wait_ms, LONGEST_POLL_MS)) {
    await pause(wait_ms, signal);
    const state = clip.path && (await stateOf(clip.path, signal));
    if (state === "stored") return;
    if (!state) lose(clip);
  }
}

/** The next attempt creates another upload. */
function lose(clip: SentClip): never {
  clip.path = null;
  clip.acknowledged_bytes = 0;
  throw new Refusal(503, "The service lost the begun upload, so it starts again.");
}

/** Removes the bytes of a cancelled upload. Without an answer, they expire after a day. */
export function forgetClip({ path }: Begun): void {
  if (path) request("DELETE", path, { headers: VERSION, signal: new AbortController().signal }).catch(() => {});
}

async function create({ home, file, key }: SentClip, signal: AbortSignal): Promise<string> {
  const metadata = encoded({ home, filename: sentName(file), idempotency_key: key });
  const headers = { ...VERSION, "upload-length": String(file.size), "upload-metadata": metadata };
  const path = (await request("POST", "/v1/uploads", { headers, signal })).getResponseHeader("location");
  if (!path) throw new Refusal(501, "The answer has no address of the upload. A proxy may have removed the header Location.");
  return path;
}

/** `Upload-Metadata`: pairs of a name and a value in base64. */
function encoded(values: Record<string, string>): string {
  const base64 = (text: string) => btoa(String.fromCharCode(...new TextEncoder().encode(text)));
  return Object.entries(values).map(([name, value]) => `${name} ${base64(value)}`).join(",");
}

/** Sends the rest of a file after the service's offset; null if the service does not have the upload any more. */
async function sendRest(
  clip: SentClip, path: string, onSent: (bytes: number) => void, signal: AbortSignal, conflicts = 0,
): Promise<Sent | null> {
  const { file } = clip;
  try {
    let answer = await request("HEAD", path, { headers: VERSION, signal });
    for (let at = offsetOf(answer); at < file.size; at = offsetOf(answer)) {
      clip.acknowledged_bytes = at;
      answer = await sendPart(clip, at, path, onSent, signal);
    }
    if (answer.getResponseHeader("viola-clip")) return "stored";
  } catch (error) {
    if (!(error instanceof Refusal)) throw error;
    // The last bytes of a broken request have moved the offset.
    if (error.status === 409 && conflicts < MOST_CONFLICTS) return sendRest(clip, path, onSent, signal, conflicts + 1);
    // Another sender of the same upload: each would refuse the other's parts for ever. A pause lets it finish.
    if (error.status === 409) throw new Refusal(503, "Another tab or device sends this file too.");
    if (![404, 410].includes(error.status)) throw error;
  }
  return stateOf(path, signal);
}

/**
 * Sends the part of a file that begins at an offset. A proxy may take smaller parts only, and says so with 413. A proxy that
 * forwards whole parts loses all of one that a slow line does not send in time, so a part that is lost twice becomes smaller.
 */
async function sendPart(
  clip: SentClip, at: number, path: string, onSent: (bytes: number) => void, signal: AbortSignal,
): Promise<XMLHttpRequest> {
  const { file } = clip;
  const headers = { ...VERSION, "upload-offset": String(at), "content-type": "application/offset+octet-stream" };
  const least_bytes = Math.max(LEAST_PART_BYTES, Math.ceil(file.size / MOST_PARTS));
  for (;;) {
    onSent(at);
    const body = file.slice(at, at + Math.max(Math.min(clip.part_bytes ?? PART_BYTES, most_part_bytes), least_bytes));
    try {
      return await request("PATCH", path, { headers, body, onSent: (bytes) => onSent(at + bytes), signal });
    } catch (error) {
      if (!(error instanceof Refusal)) throw error;
      const half_bytes = Math.max(LEAST_PART_BYTES, Math.floor(body.size / 2));
      if (LOST.includes(error.status)) {
        if (clip.lost_at === at) clip.part_bytes = half_bytes;
        clip.lost_at = at;
      }
      // The service itself refuses the whole file: smaller parts do not help.
      const isOfPart = error.status === 413 && !error.isOwn;
      if (!isOfPart || body.size <= least_bytes) throw error;
      most_part_bytes = Math.min(most_part_bytes, half_bytes);
    }
  }
}

function offsetOf(answer: XMLHttpRequest): number {
  return Number(answer.getResponseHeader("upload-offset"));
}

/** The state of a complete file; null if the upload is gone. Throws the reason of a refusal. */
async function stateOf(path: string, signal: AbortSignal): Promise<Sent | null> {
  const found = await upload(path, signal);
  if (found?.problem) throw refusalOf(found.problem.status, JSON.stringify(found.problem), null);
  if (found?.state === "arrived") return "arrived";
  return found?.state === "finished" ? "stored" : null;
}
