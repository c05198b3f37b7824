// Locks that the tabs of a browser share.

/** Takes a lock until `left`; false if another tab, or another part of this one, has it. True where a browser has no locks. */
export async function takeLock(name: string, left: Promise<void>): Promise<boolean> {
  // Browsers have locks for secure pages only.
  const { locks } = navigator as { locks?: LockManager };
  if (!locks) return true;
  const isTaken = new Promise<boolean>((resolve, reject) => {
    const hold = (lock: Lock | null) => {
      resolve(lock !== null);
      return lock ? left : Promise.resolve();
    };
    locks.request(name, { ifAvailable: true }, hold).catch(reject);
  });
  // A page without a right to locks does without.
  return isTaken.catch(() => true);
}

/** True if a tab has the lock. */
export async function isLocked(name: string): Promise<boolean> {
  const { locks } = navigator as { locks?: LockManager };
  const { held = [] } = (await locks?.query().catch(() => null)) ?? {};
  return held.some((lock) => lock.name === name);
}
