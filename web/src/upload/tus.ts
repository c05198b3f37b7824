// Sends a clip in parts by tus 1.0. After a loss, the next attempt resumes at the offset of the service.

import { Refusal, upload } from "../api.ts";
import { sentName } from "./names.ts";
import { request } from "./request.ts";
import { pause } from "./retry.ts";

/** Each part is durable when it is answered. The service takes at most 10 000. */
const PART_BYTES = 8 << 20;
const POLL_MS = 2000;
const VERSION = { "tus-resumable": "1.0.0" };

/** A clip that is sent; the service keeps its bytes between the attempts. */
export interface SentClip {
  home: string;
  file: File;
  /** The same for every attempt, so that a clip that arrived is not stored twice. */
  key: string;
  /** The path of the upload; null before it is created. */
  path: string | null;
  /** Bytes that the service has for sure. */
  acknowledged_bytes: number;
}

/** Sends the rest of a clip; returns when the clip is stored. `onSent` gets the number of sent bytes. */
export async function sendClip(clip: SentClip, onSent: (bytes: number) => void, signal: AbortSignal): Promise<void> {
  clip.path ??= await create(clip, signal);
  if (await sendRest(clip, clip.path, onSent, signal)) return;
  clip.path = null;
  clip.acknowledged_bytes = 0;
  throw new Refusal(503, "The service lost the begun upload, so that it begins again.");
}

/** Removes the bytes of a cancelled upload. Without an answer, they expire after a day. */
export function forgetClip({ path }: SentClip): void {
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

/** Sends a file from the service's offset on; false if the service does not have the upload any more. */
async function sendRest(clip: SentClip, path: string, onSent: (bytes: number) => void, signal: AbortSignal): Promise<boolean> {
  const { file } = clip;
  try {
    let answer = await request("HEAD", path, { headers: VERSION, signal });
    for (let at = offsetOf(answer); at < file.size; at = offsetOf(answer)) {
      clip.acknowledged_bytes = at;
      onSent(at);
      const headers = { ...VERSION, "upload-offset": String(at), "content-type": "application/offset+octet-stream" };
      const body = file.slice(at, at + PART_BYTES);
      answer = await request("PATCH", path, { headers, body, onSent: (bytes) => onSent(at + bytes), signal });
    }
    if (answer.getResponseHeader("viola-clip")) return true;
  } catch (error) {
    if (!(error instanceof Refusal)) throw error;
    // The last bytes of a broken request have moved the offset.
    if (error.status === 409) return sendRest(clip, path, onSent, signal);
    if (![404, 410].includes(error.status)) throw error;
  }
  return isStored(path, signal);
}

function offsetOf(answer: XMLHttpRequest): number {
  return Number(answer.getResponseHeader("upload-offset"));
}

/** Waits while the service reads a complete file; false if the upload is gone. Throws the reason of a refusal. */
async function isStored(path: string, signal: AbortSignal): Promise<boolean> {
  for (;;) {
    const found = await upload(path, signal);
    if (found?.problem) throw new Refusal(found.problem.status, found.problem.detail);
    if (found?.state !== "arrived") return found?.state === "finished";
    await pause(POLL_MS, signal);
  }
}
