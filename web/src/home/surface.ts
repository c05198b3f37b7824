// Loads the surface of a home when a person looks at it, and again when the map has another one.

import { file, homePath, lost } from "../api.ts";
import { bytesOf } from "../cloud/resume.ts";
import { readSurface, type Surface } from "../cloud/surface.ts";
import { messageOf } from "../parts/notices.ts";
import { patiently } from "../upload/retry.ts";
import type { HomeData } from "./data.ts";
import type { Looks } from "./looks.ts";

export class HomeSurface {
  /** Stays until a newer one is there; null on a level that was not looked at. */
  shown: Surface | null = null;
  /** The `ETag` of the shown surface. */
  private tag: string | null = null;
  /** The revision and the level of the surface that is there, on its way, or refused. */
  private wanted = "";
  private level = "";
  private hasFailed = false;
  private loading = new AbortController();

  constructor(
    private readonly onChange: () => void,
    private readonly onStatus: (text: string) => void,
    private readonly onFailed: (error: unknown) => void,
    signal: AbortSignal,
  ) {
    signal.addEventListener("abort", () => {
      this.loading.abort();
      this.shown?.dispose();
    });
  }

  /** Begins to load what is missing; calls back when it is there. */
  update(data: HomeData, looks: Looks): void {
    if (this.level !== data.level) this.forget();
    this.level = data.level;
    // A person who switches to the surface again tries again.
    if (!looks.isSurface && this.hasFailed) this.wanted = "";
    if (!looks.isSurface) return;
    const { map } = data;
    const wanted = map && map.info.points > 0 ? `${map.revision} ${map.created_at} ${data.level}` : "";
    if (wanted === this.wanted) return;
    if (!wanted) return this.forget();
    this.loading.abort();
    this.loading = new AbortController();
    [this.wanted, this.hasFailed] = [wanted, false];
    void this.load(data, this.loading.signal);
  }

  private async load({ home, level }: HomeData, signal: AbortSignal): Promise<void> {
    this.onStatus("The surface is being loaded …");
    try {
      const known = this.shown ? this.tag : null;
      const path = homePath(home.id, "map", `mesh?format=glb&level=${encodeURIComponent(level)}`);
      const read = await patiently(() => readFile(path, known, signal), signal, (error) =>
        this.onStatus(`The surface is requested again: ${messageOf(error)}`));
      const surface = read && (await readSurface(read.bytes));
      if (signal.aborted) return surface?.dispose();
      this.onStatus("");
      if (!read || !surface) return;
      this.shown?.dispose();
      [this.shown, this.tag] = [surface, read.tag];
      this.onChange();
    } catch (error) {
      if (signal.aborted) return;
      this.hasFailed = true;
      this.onStatus("");
      this.onFailed(error);
    }
  }

  private forget(): void {
    this.loading.abort();
    this.wanted = "";
    this.onStatus("");
    this.shown?.dispose();
    this.shown = null;
  }
}

/** A file with its `ETag`; null if it is the one that is known. */
async function readFile(path: string, known: string | null, signal: AbortSignal): Promise<{ bytes: ArrayBuffer; tag: string | null } | null> {
  const answer = await file(path, known, signal);
  if (answer.status === 304) return null;
  return { bytes: await bytesOf(answer, signal).catch(() => Promise.reject(lost())), tag: answer.headers.get("etag") };
}
