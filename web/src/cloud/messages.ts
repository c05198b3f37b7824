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
  /** With the service's status; 0 if it did not refuse. */
  | { what: "failed"; status: number; message: string };
