// The switches of a home: layers, height, classes.

import { h, put as fill, putAgain } from "../dom.ts";
import { onOff } from "../parts/switches.ts";
import { count, decimal, plain } from "../words.ts";
import type { HomeData } from "./data.ts";
import { LAYERS, LAYER_WORDS, MAX_CUT_M, type Looks, put } from "./looks.ts";

export class LayersPanel {
  readonly element: HTMLElement;
  private readonly classes = h("div", { class: "switches classes" });
  private readonly both: HTMLElement;
  private drawn = "";

  constructor(
    private readonly data: HomeData,
    private readonly looks: Looks,
  ) {
    const layers = LAYERS.map((layer) =>
      onOff(LAYER_WORDS[layer], looks.layers.has(layer), (isOn) =>
        looks.change((looks) => put(looks.layers, layer, isOn)), { name: layer }));
    const all = (isOn: boolean) => () => {
      looks.change((looks) => {
        for (const { class: name } of this.data.map?.info.classes ?? []) put(looks.hiddenClasses, name, !isOn);
      });
      this.draw(true);
    };
    this.both = h("div", { class: "row", role: "group", "aria-label": "Show classes" },
      h("button", { type: "button", class: "small", onclick: all(true) }, "All"),
      h("button", { type: "button", class: "small", onclick: all(false) }, "None"));
    this.element = h("div", {},
      section("Layers", true, h("div", { class: "switches" }, ...layers), this.height()),
      section("Classes", true, this.both, this.classes));
    this.draw();
  }

  private height(): HTMLElement {
    const word = h("output", {});
    const slider = h("input", {
      type: "range", min: 0.1, max: MAX_CUT_M, step: 0.05, value: this.looks.cut_m ?? MAX_CUT_M, "aria-label": "Cut at height",
    });
    const tell = (value: number) => {
      word.textContent = value >= MAX_CUT_M ? "off" : `${decimal(value, 2)} m`;
      slider.setAttribute("aria-valuetext", word.textContent);
    };
    tell(this.looks.cut_m ?? MAX_CUT_M);
    slider.addEventListener("input", () => {
      const value = Number(slider.value);
      tell(value);
      this.looks.cut(value >= MAX_CUT_M ? null : value);
    });
    return h("label", { class: "slider" }, h("span", {}, "Cut at height"), word, slider);
  }

  /** Draws the classes again when the map has others. */
  draw(isForced = false): void {
    const classes = [...(this.data.map?.info.classes ?? [])].sort((a, b) => b.points - a.points);
    const drawn = JSON.stringify([classes, this.data.map !== null]);
    if (drawn === this.drawn && !isForced) return;
    this.drawn = drawn;
    this.both.hidden = classes.length === 0;
    if (classes.length === 0) return fill(this.classes, h("p", { class: "hint" },
      this.data.map ? "This level has no points yet." : "Classes appear with the first map."));
    putAgain(this.classes, ...classes.map(({ class: name, points }) =>
      onOff(plain(name), !this.looks.hiddenClasses.has(name), (isOn) =>
        this.looks.change((looks) => put(looks.hiddenClasses, name, !isOn)),
        { colour: this.data.classNamed(name)?.color ?? "#9a9a9a", note: count(points), name })));
  }
}

/** A part of the side that can be closed. */
export function section(title: string, isOpen: boolean, ...children: (Node | null)[]): HTMLDetailsElement {
  return h("details", { class: "section", open: isOpen }, h("summary", {}, h("h2", {}, title)), ...children);
}
