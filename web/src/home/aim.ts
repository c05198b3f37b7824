// Takes points by keys: the view moves under a crosshair in its middle, and Enter takes the point there.

import type { Point3 } from "../cloud/pick.ts";
import { h } from "../dom.ts";
import type { Measure } from "./measure.ts";

/** Delay before the point is announced: a screen reader hears the last step only. */
const REST_MS = 200;

export class Aim {
  readonly element = h("div", { class: "crosshair", "aria-hidden": "true" });
  private timer = 0;
  private wasOn = false;

  /** `views` holds the plan and the stage; `shown` is the one that a person sees. */
  constructor(
    private readonly views: HTMLElement,
    private readonly measure: Measure,
    private readonly shown: () => HTMLElement | SVGElement | null,
    private readonly middle: () => Point3 | null,
    signal: AbortSignal,
  ) {
    views.append(this.element);
    views.addEventListener("keydown", (event) => this.onKey(event), { signal });
    views.addEventListener("focusin", () => this.note(), { signal });
    views.addEventListener("focusout", () => this.note(), { signal });
    signal.addEventListener("abort", () => clearTimeout(this.timer));
  }

  /** Moves the focus to the view when a measurement begins. */
  draw(): void {
    const { isOn } = this.measure;
    this.views.classList.toggle("aiming", isOn);
    if (isOn && !this.wasOn) this.shown()?.focus({ preventScroll: true });
    this.wasOn = isOn;
    this.note();
  }

  /** Tells the point in the middle soon. */
  note(): void {
    clearTimeout(this.timer);
    if (this.measure.isOn) this.timer = window.setTimeout(() => this.measure.aimAt(this.point()), REST_MS);
  }

  /** Null while the crosshair is hidden: a mouse or a finger takes the points. */
  private point(): Point3 | null {
    return this.views.querySelector(":focus-visible") ? this.middle() : null;
  }

  private onKey(event: KeyboardEvent): void {
    if (!this.measure.isOn || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "Enter") this.measure.take(this.middle());
    else if (event.key === "Backspace") this.measure.back();
    else return;
    event.preventDefault();
  }
}
