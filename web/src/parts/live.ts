// Follows what changes on the service while a page is open.

import { homePath } from "../api.ts";
import type { Job } from "../types.ts";

/** A browser opens six connections to a host at most, and each followed job holds one. */
const MAX_FOLLOWED = 2;

/** Follows jobs by their server-sent events, a few at a time. */
export class Followed {
  private readonly streams = new Map<string, EventSource>();

  constructor(
    private readonly onJob: (job: Job) => void,
    private readonly onEnd: () => void,
    signal: AbortSignal,
  ) {
    signal.addEventListener("abort", () => this.stopAll());
    // The page asks again when it is looked at, and then follows its jobs.
    document.addEventListener("visibilitychange", () => document.hidden && this.stopAll(), { signal });
  }

  /** Follows these jobs, the first ones first, and no others. */
  follow(jobs: Job[]): void {
    if (document.hidden) return;
    const wanted = new Set(jobs.slice(0, MAX_FOLLOWED).map((job) => job.id));
    for (const id of this.streams.keys()) if (!wanted.has(id)) this.stop(id);
    for (const id of wanted) if (!this.streams.has(id)) this.start(id);
  }

  private start(id: string): void {
    const stream = new EventSource(`/v1/jobs/${encodeURIComponent(id)}/events`);
    this.streams.set(id, stream);
    stream.addEventListener("job", (event: MessageEvent<string>) => this.onJob(JSON.parse(event.data) as Job));
    stream.addEventListener("end", () => {
      this.stop(id);
      this.onEnd();
    });
    // The browser does not try a refused stream again; the home's own stream tells when to follow the job again.
    stream.addEventListener("error", () => {
      if (stream.readyState === EventSource.CLOSED) this.stop(id);
    });
  }

  private stop(id: string): void {
    this.streams.get(id)?.close();
    this.streams.delete(id);
  }

  private stopAll(): void {
    for (const id of [...this.streams.keys()]) this.stop(id);
  }
}

/** Time until a refused stream is opened again. */
const REOPEN_MS = 3000;

/**
 * Calls back when a home changes, and when its stream is there again after a loss. A page that is not looked at has no
 * stream: six of them would hold all connections that a browser opens to a host.
 */
export function onHomeChange(home: string, changed: () => void, signal: AbortSignal): void {
  let stream: EventSource | null = null;
  let timer = 0;
  const close = () => {
    clearTimeout(timer);
    stream?.close();
    stream = null;
  };
  const open = () => {
    close();
    if (document.hidden || signal.aborted) return;
    const opened = new EventSource(homePath(home, "events"));
    stream = opened;
    opened.addEventListener("open", changed);
    opened.addEventListener("change", changed);
    // The browser does not try a refused stream again. Asking for the home tells the page why it was refused.
    opened.addEventListener("error", () => {
      if (opened.readyState !== EventSource.CLOSED) return;
      timer = window.setTimeout(() => {
        changed();
        open();
      }, REOPEN_MS);
    });
  };
  document.addEventListener("visibilitychange", () => (document.hidden ? close() : open()), { signal });
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
