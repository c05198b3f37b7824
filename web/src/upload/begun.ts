// Keeps the uploads that are not stored yet in the browser: a file that is added again after a reload resumes.

const ITEM = "viola.uploads";

/** An upload that the service has bytes of. */
export interface Begun {
  /** The same for every attempt, so that a clip that arrived is not stored twice. */
  key: string;
  /** The path of the upload; null before it is created. */
  path: string | null;
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
  write({ ...read(), [nameOf(home, file)]: { key, path } });
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

function read(): Record<string, Begun> {
  try {
    return JSON.parse(localStorage.getItem(ITEM) ?? "{}") as Record<string, Begun>;
  } catch {
    return {};
  }
}

function write(all: Record<string, Begun>): void {
  try {
    if (Object.keys(all).length > 0) localStorage.setItem(ITEM, JSON.stringify(all));
    else localStorage.removeItem(ITEM);
  } catch {
    // A browser that keeps nothing sends the whole file again.
  }
}
