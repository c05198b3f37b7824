// Keeps the uploads that are not stored yet in the browser: a file that is added again after a reload resumes.

const ITEM = "viola.uploads";

/** An upload that the service has bytes of. */
export interface Begun {
  /** The same for every attempt, so that a clip that arrived is not stored twice. */
  key: string;
  /** The path of the upload; null before it is created. */
  path: string | null;
}

/** The service removes an upload that is not finished after a day. */
const KEPT_MS = 24 * 3600 * 1000;

interface Kept extends Begun {
  at_ms: number;
}

interface Sent extends Begun {
  home: string;
  file: File;
}

/** The begun upload of a file; null if there is none. */
export function begunOf(home: string, file: File): Begun | null {
  return read()[nameOf(home, file)] ?? null;
}

export function keepBegun({ home, file, key, path }: Sent): void {
  const at_ms = Date.now();
  const fresh = Object.entries(read()).filter(([, kept]) => at_ms - kept.at_ms < KEPT_MS);
  write({ ...Object.fromEntries(fresh), [nameOf(home, file)]: { key, path, at_ms } });
}

/** Drops an upload, unless the same file has a newer one. */
export function dropBegun({ home, file, key }: Sent): void {
  const { [nameOf(home, file)]: begun, ...others } = read();
  if (begun?.key === key) write(others);
}

export function dropAllBegun(): void {
  write({});
}

function nameOf(home: string, { name, size, lastModified }: File): string {
  return JSON.stringify([home, name, size, lastModified]);
}

function read(): Record<string, Kept> {
  try {
    return JSON.parse(localStorage.getItem(ITEM) ?? "{}") as Record<string, Kept>;
  } catch {
    return {};
  }
}

function write(all: Record<string, Kept>): void {
  try {
    if (Object.keys(all).length > 0) localStorage.setItem(ITEM, JSON.stringify(all));
    else localStorage.removeItem(ITEM);
  } catch {
    // A browser that keeps nothing sends the whole file again.
  }
}
