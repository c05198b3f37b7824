// The tools over the stage: the level, the view, what the map is drawn as and coloured by.

import { COLOURING_WORDS, COLOURINGS } from "../cloud/colours.ts";
import { h, put } from "../dom.ts";
import { attempt } from "../parts/notices.ts";
import { shareLink } from "../parts/link.ts";
import { oneOf, showChoice } from "../parts/switches.ts";
import { levelWord } from "../words.ts";
import type { HomeData } from "./data.ts";
import type { Body, Looks } from "./looks.ts";
import type { HomeScene } from "./scene.ts";

/** Between the tools and the plan. */
const GAP_PX = 8;
const BODY_WORDS: [Body, string][] = [["points", "Points"], ["surface", "Surface"]];

export class Toolbar {
  readonly element: HTMLElement;
  private readonly level = h("select", { class: "tool", "aria-label": "Level" });
  private readonly body: HTMLFieldSetElement;
  private readonly colourings: HTMLFieldSetElement;
  private readonly top = h("button", { type: "button", class: "tool", title: "Look from above" }, "Top");
  private levels = "";

  constructor(
    private readonly data: HomeData,
    private readonly looks: Looks,
    scene: HomeScene,
    private readonly writeAddress: () => void,
    onLevel: (level: string) => void,
    signal: AbortSignal,
  ) {
    const views: ["2d" | "3d", string][] = scene.is3dThere ? [["3d", "3D"], ["2d", "2D"]] : [["2d", "2D"]];
    const view = oneOf("view", "View", views, looks.view, (view) => looks.change((looks) => (looks.view = view)));
    this.body = oneOf("body", "Draw the map as", BODY_WORDS, looks.body, (body) =>
      looks.change((looks) => (looks.body = body)));
    this.colourings = oneOf("colouring", "Colour by", COLOURINGS.map((name) => [name, COLOURING_WORDS[name]]),
      looks.colouring, (colouring) => looks.change((looks) => (looks.colouring = colouring)));
    this.level.addEventListener("change", () => onLevel(this.level.value));
    this.top.addEventListener("click", () => scene.fit("above"));
    this.element = h("div", { class: "toolbar" },
      this.level, view, this.body,
      h("button", { type: "button", class: "tool", onclick: () => scene.fit(), title: "Show all" }, "Fit"),
      this.top, this.colourings, scene.measure.button, this.share(), scene.measure.element);
    // The plan lies below the tools, which may need several rows. It does not move while a person measures in it.
    const sizes = new ResizeObserver(() => {
      if (!scene.measure.element.hidden) return;
      const { parentElement, offsetTop, offsetHeight } = this.element;
      parentElement?.style.setProperty("--tools", `${offsetTop + offsetHeight + GAP_PX}px`);
    });
    sizes.observe(this.element);
    signal.addEventListener("abort", () => sizes.disconnect());
    looks.onChange(() => this.draw());
    this.draw();
  }

  draw(): void {
    const { data, looks } = this;
    const levels = JSON.stringify([data.levels, data.level]);
    if (levels !== this.levels) {
      this.levels = levels;
      put(this.level, ...data.levels.map((name) => h("option", { value: name, selected: name === data.level, dir: "auto" }, levelWord(name))));
      this.level.hidden = !data.hasLevels;
    }
    // Tools for something that is not there.
    const hasPoints = (data.map?.info.points ?? 0) > 0;
    this.element.hidden = !data.lidar && !data.map;
    this.top.hidden = looks.view === "2d";
    this.body.hidden = looks.view === "2d" || !hasPoints;
    this.colourings.hidden = !hasPoints;
    showChoice(this.colourings, looks.colouring, (name) => looks.reasonAgainst(name));
  }

  private share(): HTMLElement {
    const button = h("button", { type: "button", class: "tool", title: "Copy a link to this view" }, "Share");
    button.addEventListener("click", () => void attempt(button, async () => {
      this.writeAddress();
      await shareLink(location.href);
    }));
    return button;
  }
}
