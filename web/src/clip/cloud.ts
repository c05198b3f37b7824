// A clip's own points, shown when one asks for them: they are megabytes.

import { classes, clipPath } from "../api.ts";
import { COLOURING_WORDS, type Colouring, NO_COLOUR } from "../cloud/colours.ts";
import type { Point3 } from "../cloud/pick.ts";
import { type Cloud, load } from "../cloud/points.ts";
import { CloudView } from "../cloud/view.ts";
import { h, put, putAgain } from "../dom.ts";
import { around, type Point2 } from "../frames.ts";
import { attempt, messageOf } from "../parts/notices.ts";
import { StatusLine } from "../parts/status.ts";
import { oneOf, showChoice } from "../parts/switches.ts";
import { isSessionEnd } from "../session.ts";
import type { Clip } from "../types.ts";
import { count, percent } from "../words.ts";
import { hasPoints } from "./facts.ts";

/** The service fuses clips into voxels of this size. */
const VOXEL_M = 0.03;
/** The view is framed by about this number of points; a ceiling is not shown. */
const MOST_OUTLINE = 2000;
const CEILING_M = 2;
const COLOURINGS: Colouring[] = ["colour", "class", "probability"];

export class ClipCloud {
  readonly element = h("section", {});
  private opened = new AbortController();
  /** The answer whose points are offered. */
  private offered = "";

  constructor(
    private readonly signal: AbortSignal,
    private readonly onSessionEnded: () => void,
  ) {
    signal.addEventListener("abort", () => this.opened.abort());
  }

  /** Offers the points of the clip's answer. They stay open while the same answer becomes the last one. */
  show(clip: Clip): void {
    const answer = hasPoints(clip) ? JSON.stringify(clip.alignment) : "";
    if (answer === this.offered) return;
    this.offered = answer;
    this.stop();
    if (answer) this.offer(clip, "Show the clip's points");
    else put(this.element);
  }

  private stop(): void {
    this.opened.abort();
    this.opened = new AbortController();
    if (this.signal.aborted) this.opened.abort();
  }

  private offer(clip: Clip, word: string, reason = ""): void {
    const button = h("button", { type: "button", "data-key": "points" }, word);
    button.addEventListener("click", () => void attempt(button, () => this.open(clip)));
    const why = reason ? h("p", { class: "reason failed", role: "alert" }, reason) : null;
    putAgain(this.element, h("h2", {}, "Points"), h("div", { class: "row" }, why, button));
  }

  private async open(clip: Clip): Promise<void> {
    const { signal } = this.opened;
    try {
      await this.read(clip, signal);
    } catch (error) {
      if (!signal.aborted) this.fail(clip, error);
    }
  }

  private fail(clip: Clip, error: unknown): void {
    if (isSessionEnd(error)) return this.onSessionEnded();
    this.stop();
    this.offer(clip, "Try again", messageOf(error));
  }

  private async read(clip: Clip, signal: AbortSignal): Promise<void> {
    const known = await classes();
    if (signal.aborted) return;
    const view = viewOf(signal);
    const status = new StatusLine("stage-facts");
    const colours = coloursOf(view);
    const toolbar = h("div", { class: "toolbar" },
      colours.element,
      h("button", { type: "button", class: "tool", onclick: () => view.fit() }, "Fit"));
    put(this.element, h("h2", {}, "Points"),
      h("div", { class: "stage small" }, h("div", { class: "views" }, view.element), toolbar, status.shown, status.said));
    view.element.querySelector("canvas")?.focus({ preventScroll: true });
    for (const { id, name, color } of known) view.setClass(id, color, name !== "ceiling");
    load(clipPath(clip, "cloud.ply"), {
      begun: (cloud) => view.setCloud(cloud, VOXEL_M),
      grown: (cloud) => {
        const isWhole = cloud.shown >= cloud.count;
        colours.show(cloud);
        status.show(isWhole ? `${count(cloud.count)} points` : percent(cloud.shown / cloud.count));
        view.draw();
      },
      ended: (cloud) => {
        const { position } = cloud.raw;
        const [places, outline]: [Point2[], Point3[]] = [[], []];
        const step = Math.max(1, Math.floor(cloud.count / MOST_OUTLINE));
        for (let i = 0; i < cloud.count; i += step) {
          const [x = 0, y = 0, z = 0] = position.subarray(3 * i, 3 * i + 3);
          places.push([x, y]);
          outline.push([x, y, Math.min(z, CEILING_M)]);
        }
        const box = around(places);
        if (box) view.setBounds([...box.min, 0], [...box.max, CEILING_M], outline);
      },
      nothing: () => this.fail(clip, new Error("The clip has no points yet.")),
      failed: (error) => this.fail(clip, error),
    }, signal);
  }
}

/** The switch of the colouring. Points without any colour are shown by class. */
function coloursOf(view: CloudView): { element: HTMLElement; show: (cloud: Cloud) => void } {
  let wanted: Colouring = "colour";
  const words = COLOURINGS.map((name): [Colouring, string] => [name, COLOURING_WORDS[name]]);
  const element = oneOf("cloud-colouring", "Colour points by", words, wanted, (colouring) => view.setColouring(wanted = colouring));
  const show = ({ hasColour }: Cloud) => {
    const colouring = wanted === "colour" && !hasColour ? "class" : wanted;
    view.setColouring(colouring);
    showChoice(element, colouring, (name) => (name === "colour" && !hasColour ? NO_COLOUR : null));
  };
  return { element, show };
}

function viewOf(signal: AbortSignal): CloudView {
  try {
    return new CloudView("The clip's points. Arrow keys turn, plus and minus go nearer and away.", signal);
  } catch {
    throw new Error("This browser does not support WebGL.");
  }
}
