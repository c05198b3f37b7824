// Decides whether and when a failed upload is sent again.

import { Refusal } from "../api.ts";

const FIRST_MS = 1000;
const LONGEST_MS = 30_000;
/** A fault of the service that comes again and again is of this file: the others must not wait for it. */
const MOST_FAULTS = 5;
/** A lost connection, a body that stalled, and faults of the service or of a proxy before it. */
const PASSING = [0, 408, 500, 502, 503, 504];

/** Milliseconds until the next attempt, after `failures` in a row; null if the same answer would come again. */
export function retryDelay_ms(error: unknown, failures: number): number | null {
  if (!(error instanceof Refusal)) return null;
  const { status, retryAfter_s } = error;
  if (!PASSING.includes(status) && !(status === 429 && retryAfter_s !== null)) return null;
  if (status === 500 && failures > MOST_FAULTS) return null;
  return Math.max(1000 * (retryAfter_s ?? 0), Math.min(LONGEST_MS, FIRST_MS * 2 ** (failures - 1)));
}

/** Returns whether a person may press "Try again": a refusal of the file itself is final. */
export function mayTryAgain(error: unknown): boolean {
  return error instanceof Refusal && (error.status >= 500 || error.status === 429);
}

/** The answer of `ask`, which is called again after each failure that passes; `onFailure` hears of these. */
export async function patiently<T>(ask: () => Promise<T>, signal: AbortSignal, onFailure?: (error: unknown) => void): Promise<T> {
  for (let failures = 1; ; failures++) {
    try {
      return await ask();
    } catch (error) {
      const wait_ms = signal.aborted ? null : retryDelay_ms(error, failures);
      if (wait_ms === null) throw error;
      onFailure?.(error);
      await pause(wait_ms, signal);
    }
  }
}

/** Waits for a time; ends at once when the browser is online again, and when the signal aborts. */
export function pause(wait_ms: number, signal: AbortSignal): Promise<void> {
  return new Promise((resolve) => {
    const end = () => {
      clearTimeout(timer);
      removeEventListener("online", end);
      signal.removeEventListener("abort", end);
      resolve();
    };
    const timer = setTimeout(end, wait_ms);
    addEventListener("online", end);
    signal.addEventListener("abort", end);
  });
}
