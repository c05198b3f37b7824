// One request whose body is a file, or a part of one. `fetch` does not tell how many bytes are sent; XMLHttpRequest does.

import { Refusal, refusalOf } from "../api.ts";

/** A connection that takes no byte for this time is lost. */
const STALLED_MS = 60_000;
/** The service answers at most 3 minutes after the last byte. */
const ANSWERED_MS = 240_000;

interface Sending {
  headers: Record<string, string>;
  body?: Blob;
  /** Called with the number of bytes of the body that are sent. */
  onSent?: (bytes: number) => void;
  signal: AbortSignal;
}

/** The answer; throws a `Refusal` with status 0 if there is none. */
export function request(method: string, path: string, { headers, body, onSent, signal }: Sending): Promise<XMLHttpRequest> {
  return new Promise((resolve, reject) => {
    signal.throwIfAborted();
    const sent = new XMLHttpRequest();
    const abort = () => sent.abort();
    let timer: ReturnType<typeof setTimeout> | undefined;
    const watch = (limit_ms: number) => {
      clearTimeout(timer);
      timer = setTimeout(abort, limit_ms);
    };
    sent.open(method, path);
    for (const [name, value] of Object.entries(headers)) sent.setRequestHeader(name, value);
    sent.upload.addEventListener("progress", ({ loaded }) => {
      watch(STALLED_MS);
      onSent?.(loaded);
    });
    sent.upload.addEventListener("loadend", () => watch(ANSWERED_MS));
    sent.addEventListener("loadend", () => {
      clearTimeout(timer);
      signal.removeEventListener("abort", abort);
    });
    sent.addEventListener("load", () => {
      if (sent.status >= 200 && sent.status < 300) resolve(sent);
      else reject(refusalOf(sent.status, sent.responseText, sent.getResponseHeader("retry-after")));
    });
    const lose = () => reject(new Refusal(0, "The connection broke before the answer arrived."));
    sent.addEventListener("error", lose);
    sent.addEventListener("abort", lose);
    signal.addEventListener("abort", abort, { once: true });
    sent.send(body ?? null);
    watch(STALLED_MS);
  });
}
