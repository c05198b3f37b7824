// Keeps the uploads that are not stored yet in the browser: a file that is added again after a reload resumes.

import { tenantNow } from "../session.ts";

const ITEM = "viola.uploads";

/** An upload that the service has bytes of. */
export interface Begun {
  /** The same for every attempt, so that a clip that arrived is not stored twice. */
  key: string;
  /** The path of the upload; null before it is created. */
  path: string | null;
}

/** The service keeps an upload for a day after its last byte, or as long as its operator set, and a slow line needs days for some. */
const KEPT_MS = 7 * 24 * 3600 * 1000;

interface Kept extends Begun {
  at_ms: number;
}

/** The properties of a file that tell it from others. */
export type Known = Pick<File, "name" | "size" | "lastModified">;

interface Sent extends Begun {
  home: string;
  file: Known;
}

/** The begun upload of a file; null if there is none. */
export function begunOf(home: string, file: Known): Begun | null {
  return read()[nameOf(home, file)] ?? null;
}

/** All begun uploads of a home. */
export function begunIn(home: string): Sent[] {
  return Object.entries(fresh()).flatMap(([name, { key, path }]): Sent[] => {
    const [tenant, of, file] = partsOf(name);
    return tenant === tenantNow() && of === home && file ? [{ home, file, key, path }] : [];
  });
}

export function keepBegun({ home, file, key, path }: Sent): void {
  write({ ...fresh(), [nameOf(home, file)]: { key, path, at_ms: Date.now() } });
}

/** Drops an upload, unless the same file has a newer one. */
export function dropBegun({ home, file, key }: Sent): void {
  const { [nameOf(home, file)]: begun, ...others } = read();
  if (begun?.key === key) write(others);
}

export function dropAllBegun(): void {
  write({});
}

/** Another person may sign in to this browser after the end of a session, so the tenant is part of it. */
function nameOf(home: string, { name, size, lastModified }: Known): string {
  return JSON.stringify([tenantNow(), home, name, size, lastModified]);
}

function partsOf(name: string): [tenant: string, home: string, file: Known | null] {
  try {
    const [tenant, home, file, size, lastModified] = JSON.parse(name) as unknown[];
    const isWhole = typeof file === "string" && typeof size === "number" && typeof lastModified === "number";
    return [String(tenant), String(home), isWhole ? { name: file, size, lastModified } : null];
  } catch {
    return ["", "", null];
  }
}

/** The uploads that the service may still have. */
function fresh(): Record<string, Kept> {
  return Object.fromEntries(Object.entries(read()).filter(([, kept]) => Date.now() - kept.at_ms < KEPT_MS));
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
