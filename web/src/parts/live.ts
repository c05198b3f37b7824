// Follows what changes on the service while a page is open.

import { homePath } from "../api.ts";
import type { Job } from "../types.ts";
import { openStream } from "./stream.ts";

/** Time between two readings of a page for whose stream no place is left. */
const CROWDED_MS = 5000;

/** Follows one running job by its server-sent events; the stream of the home tells when a queued job starts. */
export class Followed {
  private close = () => {};
  private timer = 0;
  private id = "";

  constructor(
    private readonly onJob: (job: Job) => void,
    private readonly onEnd: () => void,
    signal: AbortSignal,
  ) {
    signal.addEventListener("abort", () => this.stop());
    // The page asks again when it is looked at, and then follows its job.
    document.addEventListener("visibilitychange", () => document.hidden && this.stop(), { signal });
  }

  /** Follows the first running one of these jobs; one that is followed already stays. */
  follow(jobs: Job[]): void {
    if (document.hidden) return;
    const running = jobs.filter(({ state }) => state === "running");
    if (running.some(({ id }) => id === this.id)) return;
    this.stop();
    if (running[0]) this.start(running[0].id);
  }

  private start(id: string): void {
    this.id = id;
    const end = () => {
      this.stop();
      this.onEnd();
    };
    this.close = openStream(`/v1/jobs/${encodeURIComponent(id)}/events`, (stream) => {
      stream.addEventListener("job", (event: MessageEvent<string>) => this.onJob(JSON.parse(event.data) as Job));
      stream.addEventListener("end", end);
      // The browser does not try a refused stream again; the home's own stream tells when to follow the job again.
      stream.addEventListener("error", () => {
        if (stream.readyState === EventSource.CLOSED && this.id === id) this.stop();
      });
    }, () => {
      // The page reads the job itself, and follows it again.
      this.timer = window.setTimeout(end, CROWDED_MS);
    });
  }

  private stop(): void {
    clearTimeout(this.timer);
    this.close();
    this.id = "";
  }
}

/** Time until a refused stream is opened again; each refusal in a row doubles it. */
const REOPEN_MS = 3000;
const LONGEST_REOPEN_MS = 48_000;
/** Time until a lost stream counts as a change; the browser itself needs about 3 s to open it again. */
const LOST_MS = 5000;

/**
 * Calls back when a home changes, and when its stream is there again after a loss. A page that is not looked at has no
 * stream. A page for which no place is left calls back now and then.
 */
export function onHomeChange(home: string, changed: () => void, signal: AbortSignal): void {
  let closeStream = () => {};
  let timer = 0;
  let refusals = 0;
  const close = () => {
    clearTimeout(timer);
    timer = 0;
    closeStream();
  };
  const reopenAfter = (wait_ms: number) => {
    clearTimeout(timer);
    timer = window.setTimeout(() => {
      changed();
      open();
    }, wait_ms);
  };
  const open = () => {
    close();
    if (document.hidden || signal.aborted) return;
    closeStream = openStream(homePath(home, "events"), (stream) => {
      stream.addEventListener("open", () => {
        clearTimeout(timer);
        timer = 0;
        refusals = 0;
        changed();
      });
      stream.addEventListener("change", changed);
      // The browser opens a lost stream again, but not a refused one. Asking for the home tells the page why there is none.
      stream.addEventListener("error", () => {
        if (stream.readyState === EventSource.CLOSED) reopenAfter(Math.min(REOPEN_MS * 2 ** refusals++, LONGEST_REOPEN_MS));
        else timer ||= window.setTimeout(changed, LOST_MS);
      });
    }, () => reopenAfter(CROWDED_MS));
  };
  document.addEventListener("visibilitychange", () => (document.hidden ? close() : open()), { signal });
  // The stream of the network before may never end, and one that was refused would wait for its time.
  addEventListener("online", open, { signal });
  signal.addEventListener("abort", close);
  open();
}

/** Calls `ask` now, whenever `again` is called, and after as many milliseconds as it answers; null waits for `again`. */
export class Repeated {
  private timer = 0;
  private running = false;
  private isWanted = false;

  constructor(
    private readonly ask: () => Promise<number | null>,
    private readonly signal: AbortSignal,
  ) {
    signal.addEventListener("abort", () => clearTimeout(this.timer));
    // A page that is not looked at does not ask.
    document.addEventListener("visibilitychange", () => document.hidden || this.again(), { signal });
    addEventListener("online", () => document.hidden || this.again(), { signal });
  }

  again(): void {
    this.isWanted = true;
    if (!this.running) void this.run();
  }

  private async run(): Promise<void> {
    this.running = true;
    let wait_ms: number | null = 0;
    while (this.isWanted && !this.signal.aborted) {
      this.isWanted = false;
      clearTimeout(this.timer);
      wait_ms = await this.ask();
    }
    this.running = false;
    if (!this.signal.aborted && wait_ms !== null) this.timer = window.setTimeout(() => document.hidden || this.again(), wait_ms);
  }
}
