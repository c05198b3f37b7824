// The legend on the stage: classes, probabilities, rooms to film.

import { css, RAMP } from "../cloud/colours.ts";
import { h, put } from "../dom.ts";
import { plain } from "../words.ts";
import { WANTED, wantedRooms } from "./coverage.ts";
import type { HomeData } from "./data.ts";
import type { Looks } from "./looks.ts";

/** Below the legend, as in the style sheet, and between it and the plan. */
const AROUND_PX = 6 + 8;
/** More classes would hide the home; all of them are in the list at the side. */
const MOST_CLASSES = 10;

export class Legend {
  readonly element = h("div", { class: "legend", hidden: true });
  private drawn = "";

  constructor(
    private readonly data: HomeData,
    private readonly looks: Looks,
    signal: AbortSignal,
  ) {
    // The plan ends above the legend, which may need several rows.
    const sizes = new ResizeObserver(() => {
      const { offsetHeight } = this.element;
      const height_px = offsetHeight > 0 ? offsetHeight + AROUND_PX : 0;
      this.element.closest<HTMLElement>(".stage")?.style.setProperty("--legend", `${height_px}px`);
    });
    sizes.observe(this.element);
    signal.addEventListener("abort", () => sizes.disconnect());
    looks.onChange(() => this.draw());
    this.draw();
  }

  draw(): void {
    const entries = this.entries();
    const ramps = this.ramps();
    const drawn = JSON.stringify([entries, ramps]);
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    this.element.hidden = entries.length + ramps.length === 0;
    put(this.element, ...ramps.map(ramp), ...entries.map(([word, colour]) => {
      const swatch = h("span", { class: "swatch" });
      swatch.style.background = colour;
      return h("span", { class: "legend-entry" }, swatch, word);
    }));
  }

  private get isFused(): boolean {
    return this.looks.layers.has("points") && this.data.map !== null;
  }

  /** The titles of the colour ramps. */
  private ramps(): string[] {
    const { data, looks } = this;
    return [
      ...(this.isFused && looks.colouring === "probability" ? ["Probability"] : []),
      ...(looks.view === "2d" && looks.layers.has("coverage") && data.coverage ? ["Walls filmed"] : []),
    ];
  }

  private entries(): [string, string][] {
    const { data, looks } = this;
    const entries: [string, string][] = [];
    if (looks.layers.has("coverage") && wantedRooms(data).length > 0) entries.push(["Film here next", css(WANTED)]);
    if (!this.isFused || looks.colouring !== "class") return entries;
    const classes = [...(data.map?.info.classes ?? [])].sort((a, b) => b.points - a.points);
    const shown = classes.filter(({ class: name }) => !looks.hiddenClasses.has(name)).slice(0, MOST_CLASSES);
    return [...entries, ...shown.map(({ class: name }): [string, string] =>
      [plain(name), data.classNamed(name)?.color ?? "#9a9a9a"])];
  }
}

function ramp(word: string): HTMLElement {
  const bar = h("span", { class: "ramp" });
  bar.style.background = `linear-gradient(to right, ${RAMP.map(css).join(", ")})`;
  return h("span", { class: "legend-entry" }, h("span", {}, `${word}: 0`), bar, h("span", {}, "1"));
}
