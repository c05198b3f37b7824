// Streams of events, few enough for the connections of a browser.

import { takeLock } from "./locks.ts";

/** A browser opens six connections to a host for all its windows. Each stream holds one, and requests need the others. */
const MOST_STREAMS = 3;

/**
 * Opens a stream of events and gives it to `opened`, or calls `crowded` if this browser's windows have as many as they may.
 * Returns the function that closes the stream.
 */
export function openStream(path: string, opened: (stream: EventSource) => void, crowded: () => void): () => void {
  let stream: EventSource | null = null;
  let isClosed = false;
  let close = () => {};
  const closed = new Promise<void>((resolve) => {
    close = () => {
      isClosed = true;
      stream?.close();
      resolve();
    };
  });
  void takePlace(closed).then((isTaken) => {
    if (isClosed) return;
    if (!isTaken) return crowded();
    stream = new EventSource(path);
    opened(stream);
  });
  return close;
}

/** Takes one of the places of this browser's streams until `left`; false if all are taken. */
async function takePlace(left: Promise<void>): Promise<boolean> {
  for (let place = 1; place <= MOST_STREAMS; place++) {
    if (await takeLock(`viola stream ${place}`, left)) return true;
  }
  return false;
}
