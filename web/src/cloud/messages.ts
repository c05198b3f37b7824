// Messages between the page and its worker.

import type { Points } from "./ply.ts";

/** The page asks for the first address that is there. */
export interface Ask {
  urls: string[];
}

export type Told =
  | { what: "begin"; count: number; hasClips: boolean }
  | { what: "points"; at: number; points: Points }
  | { what: "end" }
  /** Nothing at any of the addresses. */
  | { what: "nothing" }
  /** With the service's status and delay; the status is 0 if the connection was lost, and null if the points cannot be read. */
  | { what: "failed"; status: number | null; retryAfter_s: number | null; message: string };
