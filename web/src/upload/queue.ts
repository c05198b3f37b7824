// The files of a home that wait, go, or failed. A queue outlives its page: one may look elsewhere while files go.

import { homePath, Refusal } from "../api.ts";
import { h } from "../dom.ts";
import { alarm, messageOf, say } from "../parts/notices.ts";
import { bytes, percent } from "../words.ts";
import type { Kind } from "./kind.ts";
import { send } from "./send.ts";

interface Upload {
  file: File;
  kind: Kind;
  /** The level that a LiDAR map is put for. */
  level: string;
  /** The same for every attempt, so that a clip that arrived is not stored twice. */
  key: string;
  row: HTMLElement;
  stop: AbortController;
}

const WORDS: Record<Kind, string> = { clip: "Clip", map: "LiDAR map" };

const queues = new Map<string, UploadQueue>();

/** The queue of a home, with the rows of files that are not through. */
export function queueOf(home: string): UploadQueue {
  const queue = queues.get(home) ?? new UploadQueue(home);
  queues.set(home, queue);
  return queue;
}

/** Ends all uploads: they are of the person who signs out. */
export function stopUploads(): void {
  for (const queue of queues.values()) queue.stop();
  queues.clear();
}

/** Random visible letters; `crypto.randomUUID` is only there over TLS. */
function randomKey(): string {
  return Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, "0")).join("");
}

/** Returns whether the same file may be taken later: a refusal of the file itself is final. */
function isPassing(error: unknown): boolean {
  return error instanceof Refusal && (error.status < 400 || error.status >= 500 || [401, 408, 429].includes(error.status));
}

class UploadQueue {
  readonly list = h("ul", { class: "uploads", "aria-label": "Uploads" });
  readonly said = h("p", { class: "hidden-text", role: "status", "aria-live": "polite" });
  /** Called when a file is stored; the page of the home sets it. */
  onDone: () => void = () => {};
  private waiting: Upload[] = [];
  private isSending = false;
  private sent: Upload | null = null;
  /** The browser asks before a tab with unsent files is closed. */
  private readonly askBeforeLeaving = (event: BeforeUnloadEvent) => event.preventDefault();

  constructor(private readonly home: string) {}

  add(file: File, kind: Kind, level: string): void {
    this.enter({ file, kind, level, key: randomKey(), row: h("li", {}), stop: new AbortController() });
  }

  stop(): void {
    this.waiting = [];
    this.sent?.stop.abort();
    this.list.replaceChildren();
  }

  private enter(upload: Upload): void {
    const { file, kind, row } = upload;
    const close = h("button", { type: "button", class: "quiet icon", "aria-label": `Cancel ${file.name}` }, "✕");
    close.addEventListener("click", () => {
      upload.stop.abort();
      this.waiting = this.waiting.filter((other) => other !== upload);
      row.remove();
    });
    row.className = "";
    row.replaceChildren(h("span", { class: "kind" }, WORDS[kind]), h("span", { class: "file" }, file.name),
      h("span", { class: "hint" }, "waits"), close);
    this.list.append(row);
    // Clips wait for a map anyway, so that the map goes first.
    this.waiting = kind === "map" ? [upload, ...this.waiting] : [...this.waiting, upload];
    void this.work();
  }

  /** One at a time: two would only share the same line. */
  private async work(): Promise<void> {
    if (this.isSending) return;
    this.isSending = true;
    addEventListener("beforeunload", this.askBeforeLeaving);
    for (let upload = this.waiting.shift(); upload; upload = this.waiting.shift()) await this.sendOne(upload);
    removeEventListener("beforeunload", this.askBeforeLeaving);
    this.isSending = false;
  }

  private async sendOne(upload: Upload): Promise<void> {
    const { file, kind, level, key, row, stop } = upload;
    this.sent = upload;
    const bar = h("progress", { max: 1, value: 0, "aria-label": `Upload of ${file.name}` });
    row.append(bar);
    const onSent = (share: number) => {
      bar.value = share;
      const word = row.querySelector(".hint");
      if (word) word.textContent = share < 1 ? `${percent(share)} of ${bytes(file.size)}` : "being read";
    };
    onSent(0);
    try {
      if (kind === "clip") await send("POST", homePath(this.home, "clips"), file, onSent, stop.signal, key);
      else await send("PUT", homePath(this.home, "lidar-maps", encodeURIComponent(level)), file, onSent, stop.signal);
      this.said.textContent = `${file.name} is stored.`;
      if (!row.isConnected) say(`${file.name} is stored.`);
      row.remove();
      this.onDone();
    } catch (error) {
      if (!stop.signal.aborted) this.fail(upload, error);
    }
  }

  private fail(upload: Upload, error: unknown): void {
    const { file, row } = upload;
    if (!row.isConnected) alarm(`${file.name} is not stored: ${messageOf(error)}`);
    row.className = "failed";
    row.querySelector("progress")?.remove();
    row.querySelector(".hint")?.remove();
    row.append(h("p", { class: "reason", role: "alert" }, messageOf(error)));
    if (!isPassing(error)) return;
    const again = h("button", { type: "button", class: "small" }, "Try again");
    again.addEventListener("click", () => this.enter(upload));
    row.append(again);
  }
}
