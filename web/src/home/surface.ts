// Loads the surface of a home when a person looks at it, and again when the map has changed meanwhile.

import { explanation, homePath, Refusal } from "../api.ts";
import { readSurface, type Surface } from "../cloud/surface.ts";
import { messageOf } from "../parts/notices.ts";
import type { HomeData } from "./data.ts";
import type { Looks } from "./looks.ts";

export class HomeSurface {
  /** Stays until a newer one is there; null on a level that was not looked at. */
  shown: Surface | null = null;
  /** The revision and the level of the surface that is there or on its way. */
  private wanted = "";
  private level = "";
  private loading = new AbortController();

  constructor(
    private readonly onChange: () => void,
    private readonly onStatus: (text: string) => void,
    private readonly onFailed: (text: string) => void,
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
    if (!looks.isSurface) return;
    const { map } = data;
    const wanted = map && map.info.points > 0 ? `${map.revision} ${map.created_at} ${data.level}` : "";
    if (wanted === this.wanted) return;
    this.wanted = wanted;
    this.loading.abort();
    if (!wanted) return this.forget();
    this.loading = new AbortController();
    void this.load(data, this.loading.signal);
  }

  private async load({ home, level }: HomeData, signal: AbortSignal): Promise<void> {
    this.onStatus("The surface is made …");
    try {
      const answer = await fetch(homePath(home.id, "map", `mesh?format=glb&level=${encodeURIComponent(level)}`), { signal });
      if (!answer.ok) throw new Refusal(answer.status, explanation(answer.status, await answer.text()));
      const surface = await readSurface(await answer.arrayBuffer());
      if (signal.aborted) return surface.dispose();
      this.shown?.dispose();
      this.shown = surface;
      this.onStatus("");
      this.onChange();
    } catch (error) {
      if (signal.aborted) return;
      this.onStatus("");
      this.onFailed(`The surface: ${messageOf(error)}`);
      this.wanted = "";
    }
  }

  private forget(): void {
    this.loading.abort();
    this.wanted = "";
    this.shown?.dispose();
    this.shown = null;
  }
}
