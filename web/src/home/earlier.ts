// Lists the earlier LiDAR maps of the shown level, to make one of them the current map again.

import * as api from "../api.ts";
import { h, put, putAgain } from "../dom.ts";
import { attempt, messageOf, say } from "../parts/notices.ts";
import type { LidarRevision } from "../types.ts";
import { levelWord, named, time } from "../words.ts";
import type { HomeData } from "./data.ts";

export class EarlierMaps {
  readonly element = h("div", {});
  /** The level and the current revision of the shown list; empty before the first one. */
  private shown = "";

  constructor(
    private readonly data: HomeData,
    private readonly onRestored: () => void,
    private readonly signal: AbortSignal,
  ) {}

  /** Reads the maps again if the level has a new one, or another level is shown; the panel must be open for that. */
  async draw(): Promise<void> {
    const { home, level, lidar } = this.data;
    const shown = `${level} ${lidar?.revision ?? 0}`;
    if (shown === this.shown || this.element.closest("details")?.open !== true) return;
    this.shown = shown;
    try {
      const maps = lidar ? otherFiles(await api.lidarRevisions(home.id, level, this.signal)) : [];
      if (shown !== this.shown) return;
      if (maps.length === 0) return putAgain(this.element, h("p", { class: "hint" }, "This level has no earlier LiDAR map."));
      putAgain(this.element, h("ul", { class: "removed" }, ...maps.map((map) => this.row(map))));
    } catch (error) {
      if (this.signal.aborted || shown !== this.shown) return;
      this.shown = "";
      put(this.element, h("p", { class: "reason", role: "status" }, messageOf(error)));
    }
  }

  private row({ level, revision, file_name, created_at }: LidarRevision): HTMLElement {
    const word = file_name ?? `LiDAR map ${revision}`;
    const button = h("button", { type: "button", class: "small", "data-key": revision }, "Restore");
    button.setAttribute("aria-label", `Restore ${word} of ${time(created_at)}`);
    button.addEventListener("click", () => void attempt(button, async () => {
      await api.restoreLidarMap(this.data.home.id, level, revision);
      say(`${named(word)} is the LiDAR map of the level “${levelWord(level)}” again. All clips are placed again.`);
      this.onRestored();
    }));
    return h("li", {}, h("span", { class: "word", dir: "auto" }, word), h("span", { class: "hint" }, time(created_at)), button);
  }
}

/** The newest revision of each file that is not the current one; `revisions` begins with the current one. */
export function otherFiles(revisions: readonly LidarRevision[]): LidarRevision[] {
  return revisions.filter(({ sha256 }, i) => revisions.findIndex((other) => other.sha256 === sha256) === i).slice(1);
}
