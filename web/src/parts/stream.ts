// Streams of events, few enough for the connections of a browser.

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
  // Browsers have locks for secure pages only.
  const { locks } = navigator as { locks?: LockManager };
  if (!locks) return true;
  for (let place = 1; place <= MOST_STREAMS; place++) {
    const isTaken = new Promise<boolean>((resolve, reject) => {
      const hold = (lock: Lock | null) => {
        resolve(lock !== null);
        return lock ? left : Promise.resolve();
      };
      locks.request(`viola stream ${place}`, { ifAvailable: true }, hold).catch(reject);
    });
    // A page without a right to locks does without.
    if (await isTaken.catch(() => true)) return true;
  }
  return false;
}
