// Messages between the page and its worker.

import type { Points } from "./ply.ts";

/** The page asks for the points at an address. */
export interface Ask {
  url: string;
  /** The `ETag` of points that the page has already; null without any. */
  known: string | null;
}

export type Told =
  | { what: "begin"; count: number; hasClips: boolean; tag: string | null }
  | { what: "points"; at: number; points: Points }
  | { what: "end" }
  /** The points are those that the page has. */
  | { what: "same" }
  /** Nothing at the address. */
  | { what: "nothing" }
  /** With the service's status and delay; the status is 0 if the connection was lost, and null if the points cannot be read. */
  | { what: "failed"; status: number | null; retryAfter_s: number | null; message: string };
