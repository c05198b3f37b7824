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
    signal.addEventListener("abort", () => {
      for (const stream of this.streams.values()) stream.close();
      this.streams.clear();
    });
  }

  /** Follows these jobs, the first ones first, and no others. */
  follow(jobs: Job[]): void {
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
    // A stream that cannot be opened is not tried again by the browser; asking from time to time goes on anyway.
    stream.addEventListener("error", () => {
      if (stream.readyState === EventSource.CLOSED) this.stop(id);
    });
  }

  private stop(id: string): void {
    this.streams.get(id)?.close();
    this.streams.delete(id);
  }
}

/** Calls back when a home changes, and when the connection is there again after a loss. */
export function onHomeChange(home: string, changed: () => void, signal: AbortSignal): void {
  const stream = new EventSource(homePath(home, "events"));
  stream.addEventListener("open", changed);
  stream.addEventListener("change", changed);
  signal.addEventListener("abort", () => stream.close());
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
