// Sends a LiDAR map, and takes a replacement back.

import { lidarPath, Refusal, restoreLidarMap } from "../api.ts";
import { attempt, offer, say } from "../parts/notices.ts";
import { levelWord } from "../words.ts";
import { sentName } from "./names.ts";
import { request } from "./request.ts";

/** The level of a LiDAR map. */
export interface Target {
  level: string;
  /** The revision of the map that the file replaces; null if the level has none. */
  replaces: number | null;
}

const TOO_LARGE = "The map is larger than this service takes. Export it with larger cells, or add the file that the robot itself makes.";

/** The page's words for a body that is too large are about clips; a proxy before the service gives no words of the service. */
function ofMap(error: unknown): unknown {
  return error instanceof Refusal && error.status === 413 && error.detail !== null
    ? new Refusal(413, TOO_LARGE, null, error.detail)
    : error;
}

/** Sends a map; returns its revision. */
export async function sendMap(
  home: string,
  level: string,
  file: File,
  onSent: (bytes: number) => void,
  signal: AbortSignal,
): Promise<number> {
  const name = sentName(file);
  const query = name ? `?filename=${encodeURIComponent(name)}` : "";
  const path = lidarPath(home, level) + query;
  const answer = await request("PUT", path, { headers: { "content-type": "application/octet-stream" }, body: file, onSent, signal })
    .catch((error: unknown) => Promise.reject(ofMap(error)));
  return (JSON.parse(answer.responseText) as { revision: number }).revision;
}

/** Tells that a map is replaced, and offers the earlier one. */
export function offerUndo(home: string, level: string, replaced: number, onDone: () => void): void {
  offer(`The map of the level “${levelWord(level)}” is replaced.`, "Undo", () => attempt(null, async () => {
    await restoreLidarMap(home, level, replaced);
    say(`The level “${levelWord(level)}” has its earlier map again.`);
    onDone();
  }));
}
