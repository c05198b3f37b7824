// A clip's own points, shown when one asks for them: they are megabytes.

import { clipPath } from "../api.ts";
import { classes } from "../api.ts";
import { COLOURING_WORDS, type Colouring } from "../cloud/colours.ts";
import { load } from "../cloud/points.ts";
import { CloudView } from "../cloud/view.ts";
import { h, put } from "../dom.ts";
import { around } from "../frames.ts";
import { alarm } from "../parts/notices.ts";
import { oneOf } from "../parts/switches.ts";
import type { Clip } from "../types.ts";
import { count, percent } from "../words.ts";

/** The service fuses clips into voxels of this size. */
const VOXEL_M = 0.03;
const COLOURINGS: Colouring[] = ["colour", "class", "probability"];

export class ClipCloud {
  readonly element = h("section", {});
  private opened = new AbortController();
  private job = "";

  constructor(private readonly signal: AbortSignal) {
    signal.addEventListener("abort", () => this.opened.abort());
  }

  /** Offers the points of the clip's newest answer. */
  show(clip: Clip): void {
    const job = clip.alignment ? (clip.job?.id ?? "answer") : "";
    if (job === this.job) return;
    this.job = job;
    this.opened.abort();
    this.opened = new AbortController();
    if (!job) return put(this.element);
    const button = h("button", { type: "button" }, "Show the clip's points");
    button.addEventListener("click", () => void this.open(clip));
    put(this.element, h("h2", {}, "Points"), button);
  }

  private async open(clip: Clip): Promise<void> {
    const { signal } = this.opened;
    const view = this.viewOrNot(signal);
    if (!view) return;
    const status = h("p", { class: "stage-facts", role: "status" });
    const toolbar = h("div", { class: "toolbar" },
      oneOf("cloud-colouring", "Colour points by", COLOURINGS.map((name) => [name, COLOURING_WORDS[name]]), "colour",
        (colouring) => view.setColouring(colouring)),
      h("button", { type: "button", class: "tool", onclick: () => view.fit() }, "Fit"));
    put(this.element, h("h2", {}, "Points"),
      h("div", { class: "stage small" }, h("div", { class: "views" }, view.element), toolbar, status));
    for (const { id, name, color } of await classes()) view.setClass(id, color, name !== "ceiling");
    load([clipPath(clip, "cloud.ply")], {
      begun: (cloud) => view.setCloud(cloud, VOXEL_M),
      grown: (cloud) => {
        const isWhole = cloud.shown >= cloud.count;
        status.textContent = isWhole ? `${count(cloud.count)} points` : percent(cloud.shown / cloud.count);
        view.draw();
      },
      ended: (cloud) => {
        const { position } = cloud.raw;
        const places = function* () {
          for (let i = 0; i < position.length; i += 3) yield [position[i] ?? 0, position[i + 1] ?? 0] as const;
        };
        const box = around(places());
        if (box) view.setBounds([...box.min, 0], [...box.max, 2]);
      },
      nothing: () => put(this.element),
      failed: alarm,
    }, this.signal.aborted ? this.signal : signal);
  }

  private viewOrNot(signal: AbortSignal): CloudView | null {
    try {
      return new CloudView("The clip's points. Arrow keys turn, plus and minus go nearer and away.", signal);
    } catch {
      alarm("This browser gives no WebGL, which points need.");
      return null;
    }
  }
}
