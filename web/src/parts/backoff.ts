// Attempts after failures in a row: each one comes later than the one before, and a hidden page makes none.

import { retryDelay_ms } from "../upload/retry.ts";

/** Time between two readings after a failure that would come again: a person may have mended its cause meanwhile. */
const FINAL_MS = 30_000;

export class Backoff {
  private failures = 0;

  reset(): void {
    this.failures = 0;
  }

  /** Counts a failure; returns the milliseconds until the next attempt, or null if the same failure would come again. */
  next_ms(error: unknown): number | null {
    return retryDelay_ms(error, ++this.failures);
  }

  /** The same for a page that is shown already, and that is read again after every failure. */
  nextReading_ms(error: unknown): number {
    return this.next_ms(error) ?? FINAL_MS;
  }
}

/** Calls back once: after a time, when the browser is online again, or when a person looks at the page again. */
export function whenDue(wait_ms: number, attempt: () => void, signal: AbortSignal): void {
  const done = new AbortController();
  const waiting = AbortSignal.any([signal, done.signal]);
  const act = () => {
    if (document.hidden || waiting.aborted) return;
    done.abort();
    attempt();
  };
  const timer = setTimeout(act, wait_ms);
  waiting.addEventListener("abort", () => clearTimeout(timer));
  addEventListener("online", act, { signal: waiting });
  document.addEventListener("visibilitychange", act, { signal: waiting });
}
