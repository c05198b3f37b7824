// Lists the objects that a person removed from the map, to bring them back.

import * as api from "../api.ts";
import { h, put, putAgain } from "../dom.ts";
import { attempt, messageOf, say } from "../parts/notices.ts";
import type { Corrections } from "../types.ts";
import { named, plain, time } from "../words.ts";
import type { HomeData } from "./data.ts";
import { withoutLevel } from "./selection.ts";

export class RemovedPanel {
  readonly element = h("div", {});
  /** The map and the number of removals of the shown list; empty before the first one. */
  private shown = "";

  constructor(
    private readonly data: HomeData,
    private readonly onCorrected: () => void,
    private readonly signal: AbortSignal,
  ) {}

  /** Reads the corrections again after a removal and with a new map; the panel must be open for that. */
  async draw(): Promise<void> {
    const shown = `${this.data.map?.revision ?? 0} ${this.data.removals}`;
    if (shown === this.shown || this.element.closest("details")?.open !== true) return;
    this.shown = shown;
    await this.read(shown);
  }

  /** An answer that comes after a later removal is old: the later reading shows its own. */
  private async read(shown: string): Promise<void> {
    try {
      const { objects } = await api.corrections(this.data.home.id, this.signal);
      if (shown !== this.shown) return;
      const removed = objects.filter(({ hidden }) => hidden);
      if (removed.length === 0) return putAgain(this.element, h("p", { class: "hint" }, "No object is removed."));
      putAgain(this.element, h("ul", { class: "removed" }, ...removed.map((object) => this.row(object))));
    } catch (error) {
      if (this.signal.aborted || shown !== this.shown) return;
      this.shown = "";
      put(this.element, h("p", { class: "reason", role: "status" }, messageOf(error)));
    }
  }

  private row({ id, name, class: corrected, corrected_at }: Corrections["objects"][number]): HTMLElement {
    // The service keeps no class that nobody corrected, but an id begins with the first class of its object.
    const word = name ?? plain(corrected ?? withoutLevel(id).replace(/-(\d+)$/, " $1"));
    const button = h("button", { type: "button", class: "small", "data-key": id }, "Bring back");
    button.setAttribute("aria-label", `Bring back ${word}`);
    button.addEventListener("click", () => void attempt(button, async () => {
      await api.correctThing(this.data.home.id, id, { hidden: null });
      this.data.bringBack(id);
      say(`${named(word)} is brought back. The map is being rebuilt.`);
      await this.draw();
      this.onCorrected();
    }));
    return h("li", {}, h("span", { class: "word", dir: "auto" }, word), h("span", { class: "hint" }, time(corrected_at)), button);
  }
}
