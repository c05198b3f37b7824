// Waits for changes of all homes.

import { feed, Refusal } from "../api.ts";

/** The end of the feed, as far as this tab has read it; null for the start. */
let cursor: string | null = null;

/** Waits for the next change. The first call reads the feed to its end. */
export async function nextChange(signal: AbortSignal): Promise<void> {
  try {
    for (;;) {
      const { items, next, more } = await feed(cursor, signal);
      cursor = next;
      if (items.length > 0 && !more) return;
    }
  } catch (error) {
    // The service does not keep all changes for ever.
    if (error instanceof Refusal && error.status === 410) cursor = null;
    throw error;
  }
}
