// One request whose body is a file, or a part of one. `fetch` does not tell how many bytes are sent; XMLHttpRequest does.

import { explanation, Refusal } from "../api.ts";

/** A connection that takes no byte for this time is lost. */
const STALLED_MS = 60_000;

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
    const watch = () => {
      clearTimeout(timer);
      timer = setTimeout(abort, STALLED_MS);
    };
    sent.open(method, path);
    for (const [name, value] of Object.entries(headers)) sent.setRequestHeader(name, value);
    sent.upload.addEventListener("loadstart", watch);
    sent.upload.addEventListener("progress", ({ loaded }) => {
      watch();
      onSent?.(loaded);
    });
    // The service may take its time once it has the body.
    sent.upload.addEventListener("loadend", () => clearTimeout(timer));
    sent.addEventListener("loadend", () => signal.removeEventListener("abort", abort));
    sent.addEventListener("load", () => {
      if (sent.status >= 200 && sent.status < 300) resolve(sent);
      else reject(new Refusal(sent.status, explanation(sent.status, sent.responseText), retryAfter_s(sent)));
    });
    const lose = () => reject(new Refusal(0, "The connection broke before the answer arrived."));
    sent.addEventListener("error", lose);
    sent.addEventListener("abort", lose);
    signal.addEventListener("abort", abort, { once: true });
    sent.send(body ?? null);
  });
}

/** The seconds in `Retry-After`; null if it is missing or a date. */
function retryAfter_s(answer: XMLHttpRequest): number | null {
  const text = answer.getResponseHeader("retry-after") ?? "";
  return /^\d+$/.test(text) ? Number(text) : null;
}
