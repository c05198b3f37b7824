// Loads the surface of a home when a person looks at it, and again when the map has another one.

import * as api from "../api.ts";
import { readSurface, type Surface } from "../cloud/surface.ts";
import { pause, retryDelay_ms } from "../upload/retry.ts";
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
      const answer = await patiently(() => api.surface(home.id, level, known, signal), signal);
      const surface = answer && (await readSurface(answer.glb));
      if (signal.aborted) return surface?.dispose();
      this.onStatus("");
      if (!answer || !surface) return;
      this.shown?.dispose();
      [this.shown, this.tag] = [surface, answer.tag];
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

/** Asks again while the service is busy: the surface of a new map is made on request. */
async function patiently<T>(ask: () => Promise<T>, signal: AbortSignal): Promise<T> {
  for (let failures = 1; ; failures++) {
    try {
      return await ask();
    } catch (error) {
      const wait_ms = error instanceof api.Refusal && error.status === 503 ? retryDelay_ms(error, failures) : null;
      if (wait_ms === null || signal.aborted) throw error;
      await pause(wait_ms, signal);
    }
  }
}
