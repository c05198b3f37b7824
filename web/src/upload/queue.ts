// The files of a home that wait, are being sent, or failed. A queue outlives its page.

import { Refusal } from "../api.ts";
import { h } from "../dom.ts";
import { takeLock } from "../parts/locks.ts";
import { alarm, messageOf, say } from "../parts/notices.ts";
import { isSessionEnd, reportSessionEnd } from "../session.ts";
import { levelWord, named } from "../words.ts";
import { type Begun, begunOf, dropAllBegun, dropBegun } from "./begun.ts";
import { offerUndo, sendMap, type Target } from "./map.ts";
import { mayTryAgain, pause, retryDelay_ms } from "./retry.ts";
import { UploadRow } from "./row.ts";
import { forgetClip, sendClip, type Sent, type SentClip, untilStored } from "./tus.ts";

interface Upload extends SentClip {
  /** The level of a LiDAR map; null for a clip. */
  target: Target | null;
  row: UploadRow;
  stop: AbortController;
  /** Gives the lock of the upload back. */
  leave: () => void;
  left: Promise<void>;
  isOwned: boolean;
}

/** The lock of an upload: two tabs that send the same one would refuse each other's parts. */
export function lockOf({ key }: Begun): string {
  return `viola upload ${key}`;
}

const queues = new Map<string, UploadQueue>();

/** The queue of a home, with the rows of files that are not stored yet. */
export function queueOf(home: string): UploadQueue {
  const queue = queues.get(home) ?? new UploadQueue(home);
  queues.set(home, queue);
  return queue;
}

/** The number of files of all homes that are not sent yet. */
export function unsentFiles(): number {
  return [...queues.values()].reduce((sum, { unsent }) => sum + unsent, 0);
}

/** Sends the files of all homes that wait for a session. */
export function resumeUploads(): void {
  for (const queue of queues.values()) queue.resume();
}

/** Ends all uploads: they are of the person who signs out. */
export function stopUploads(): void {
  for (const queue of queues.values()) queue.stop();
  queues.clear();
  dropAllBegun();
}

/** Random visible letters; `crypto.randomUUID` is only there over TLS. */
function randomKey(): string {
  return Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, "0")).join("");
}

/** A lost connection and a file that cannot be read any more are the same to XMLHttpRequest. */
async function isReadable(file: File): Promise<boolean> {
  return file.slice(0, 1).arrayBuffer().then(() => true, () => false);
}

export class UploadQueue {
  readonly list = h("ul", { class: "uploads", "aria-label": "Uploads" });
  readonly said = h("p", { class: "hidden-text", role: "status", "aria-live": "polite" });
  /** Called when a file is stored; the page of the home sets it. */
  onDone: () => void = () => {};
  /** The first one is being sent. */
  private waiting: Upload[] = [];
  /** Clips whose bytes are all sent, and that the service still reads. */
  private readonly arrived = new Set<Upload>();
  /** Files that a person may try again. */
  private readonly failed = new Set<Upload>();
  private isSending = false;
  /** The browser asks before a tab with unsent files is closed. */
  private readonly askBeforeLeaving = (event: BeforeUnloadEvent) => event.preventDefault();

  constructor(private readonly home: string) {}

  get unsent(): number {
    return this.waiting.length;
  }

  /** The levels whose LiDAR map is not sent yet. */
  get levels(): string[] {
    return this.waiting.flatMap(({ target }) => (target ? [target.level] : []));
  }

  addClip(file: File): void {
    this.add(file, "Clip", null);
  }

  addMap(file: File, target: Target): void {
    this.add(file, `LiDAR map · ${levelWord(target.level)}`, target);
  }

  /** Sends the files that still wait, for example after a new sign-in. */
  resume(): void {
    if (this.waiting.length > 0) void this.work();
  }

  /** Lets the page of the home go: the queue would keep its points in memory. */
  leavePage(): void {
    this.onDone = () => {};
    this.list.remove();
    this.said.remove();
  }

  stop(): void {
    for (const { stop } of [...this.waiting, ...this.arrived]) stop.abort();
    for (const { leave } of this.all) leave();
    this.waiting = [];
    this.arrived.clear();
    this.failed.clear();
    this.list.replaceChildren();
    this.letLeave();
  }

  private add(file: File, kind: string, target: Target | null): void {
    const row = new UploadRow(file, kind, () => this.cancel(upload));
    const { key, path } = (!target && this.resumable(file)) || { key: randomKey(), path: null };
    let leave = () => {};
    const left = new Promise<void>((resolve) => (leave = resolve));
    const upload: Upload = {
      home: this.home, file, key, path, acknowledged_bytes: 0, target, row, stop: new AbortController(), leave, left, isOwned: false,
    };
    this.list.append(row.element);
    this.enter(upload);
  }

  /** The upload of a file that was begun before a reload; null if there is none, or if this queue sends it already. */
  private resumable(file: File): Begun | null {
    const begun = begunOf(this.home, file);
    return begun && this.has(begun.key) ? null : begun;
  }

  private get all(): Upload[] {
    return [...this.waiting, ...this.arrived, ...this.failed];
  }

  /** True if this queue sends an upload, or may send it again. */
  has(key: string): boolean {
    return this.all.some((upload) => upload.key === key);
  }

  /** Takes the lock of an upload. A file that another tab sends becomes a clip of its own. */
  private async own(upload: Upload): Promise<void> {
    if (upload.isOwned || upload.target) return;
    while (!(await takeLock(lockOf(upload), upload.left))) [upload.key, upload.path] = [randomKey(), null];
    upload.isOwned = true;
  }

  private cancel(upload: Upload): void {
    upload.stop.abort();
    this.waiting = this.waiting.filter((other) => other !== upload);
    this.arrived.delete(upload);
    this.failed.delete(upload);
    upload.row.remove();
    upload.leave();
    dropBegun(upload);
    forgetClip(upload);
    this.letLeave();
  }

  private letLeave(): void {
    if (this.waiting.length === 0) removeEventListener("beforeunload", this.askBeforeLeaving);
  }

  private enter(upload: Upload): void {
    this.failed.delete(upload);
    upload.row.wait("waits");
    // Clips wait for a map anyway, so maps go first, in their order; a file that is being sent stays first.
    const firstClip = this.waiting.findIndex(({ target }, i) => !target && i >= Number(this.isSending));
    this.waiting.splice(upload.target && firstClip >= 0 ? firstClip : this.waiting.length, 0, upload);
    void this.work();
  }

  /** Sends one file at a time: two would only share the same line. Stops when the session has ended. */
  private async work(): Promise<void> {
    if (this.isSending) return;
    this.isSending = true;
    addEventListener("beforeunload", this.askBeforeLeaving);
    for (let next = this.waiting[0]; next && (await this.sendOne(next)); next = this.waiting[0]) {
      this.waiting = this.waiting.filter((other) => other !== next);
    }
    this.letLeave();
    this.isSending = false;
  }

  /** Sends a file until it has arrived, or is refused or cancelled. False if the session has ended: the file waits. */
  private async sendOne(upload: Upload): Promise<boolean> {
    const { file, row, stop: { signal } } = upload;
    this.said.textContent = `${named(file.name)} is being sent.`;
    row.progress(0);
    for (let failures = 1; !signal.aborted; failures++) {
      const before_bytes = upload.acknowledged_bytes;
      try {
        await this.own(upload);
        if ((await this.send(upload)) === "arrived") void this.follow(upload);
        else this.finish(upload);
        return true;
      } catch (error) {
        if (signal.aborted) return true;
        if (upload.acknowledged_bytes > before_bytes) failures = 1;
        const unreadable = (await isReadable(file)) ? null : new Error("The file cannot be read any more. Add it again.");
        const wait_ms = unreadable ? null : retryDelay_ms(error, failures);
        if (wait_ms === null) return this.fail(upload, unreadable ?? error);
        row.wait(navigator.onLine ? "waits for the service" : "waits for the network");
        if (failures === 1) this.said.textContent = `${named(file.name)} waits: ${messageOf(error)} The upload resumes by itself.`;
        await pause(wait_ms, signal);
      }
    }
    return true;
  }

  private async send(upload: Upload): Promise<Sent> {
    const { home, file, target, row, stop: { signal } } = upload;
    const onSent = (bytes: number) => row.progress(bytes);
    if (!target) return sendClip(upload, onSent, signal);
    const { level, replaces } = target;
    const revision = await sendMap(home, level, file, onSent, signal);
    if (replaces !== null && revision !== replaces) offerUndo(home, level, replaces, () => this.onDone());
    return "stored";
  }

  /** Waits beside the queue while the service reads a file. After a fault, the queue resumes the file. */
  private async follow(upload: Upload): Promise<void> {
    const { row, stop: { signal } } = upload;
    this.arrived.add(upload);
    row.progress(upload.file.size);
    try {
      await untilStored(upload, signal);
      this.finish(upload);
    } catch (error) {
      if (signal.aborted) return;
      if (isSessionEnd(error) || retryDelay_ms(error, 1) !== null) this.enter(upload);
      else this.fail(upload, error);
    } finally {
      this.arrived.delete(upload);
    }
  }

  private finish(upload: Upload): void {
    const { file, row } = upload;
    const text = `${named(file.name)} is stored.`;
    this.said.textContent = text;
    if (!row.element.isConnected) say(text);
    row.remove();
    upload.leave();
    dropBegun(upload);
    this.onDone();
  }

  /** Shows the reason of a failure. False if the session has ended: the file waits for the next one. */
  private fail(upload: Upload, error: unknown): boolean {
    const { file, row } = upload;
    if (isSessionEnd(error)) {
      row.wait("waits for the sign-in");
      // Any page may be shown now; it asks for the key.
      reportSessionEnd(messageOf(error));
      return false;
    }
    const reason = messageOf(error);
    if (!row.element.isConnected) alarm(`${named(file.name)} is not stored: ${reason}`);
    if (mayTryAgain(error)) this.failed.add(upload);
    row.fail(reason, mayTryAgain(error) ? () => this.enter(upload) : null, error instanceof Refusal ? error.detail : null);
    if (!mayTryAgain(error)) upload.leave();
    if (error instanceof Refusal && !mayTryAgain(error)) dropBegun(upload);
    return true;
  }
}
