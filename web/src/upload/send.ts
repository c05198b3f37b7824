// Sends one file. `fetch` does not tell how much has gone, so this is the older way.

import { explanation, Refusal } from "../api.ts";

export function send(
  method: "POST" | "PUT",
  path: string,
  file: File,
  onSent: (share: number) => void,
  signal: AbortSignal,
  /** A clip that was stored under this key is not stored again. */
  idempotencyKey?: string,
): Promise<void> {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open(method, path);
    request.setRequestHeader("content-type", "application/octet-stream");
    if (idempotencyKey) request.setRequestHeader("idempotency-key", idempotencyKey);
    request.upload.addEventListener("progress", ({ loaded, total }) => onSent(total > 0 ? loaded / total : 0));
    request.addEventListener("load", () => {
      if (request.status >= 200 && request.status < 300) resolve();
      else reject(new Refusal(request.status, explanation(request.status, request.responseText)));
    });
    request.addEventListener("error", () => {
      reject(new Refusal(0, "The connection broke before the file was through. Try again."));
    });
    request.addEventListener("abort", () => reject(new Refusal(0, "Cancelled.")));
    signal.addEventListener("abort", () => request.abort(), { once: true });
    request.send(file);
  });
}
