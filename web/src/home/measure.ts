// Measures between two points of the home, and asks for lines.

import type { Point3 } from "../cloud/pick.ts";
import { h } from "../dom.ts";
import { isAsking } from "../parts/dialog.ts";
import { decimal, metres } from "../words.ts";

export class Measure {
  readonly element = h("div", { class: "measure", hidden: true });
  readonly button = h("button", { type: "button", class: "tool", "aria-pressed": "false" }, "Measure");
  /** The ends that were taken: none, one or two. */
  ends: Point3[] = [];
  private readonly text = h("span", { role: "status" });
  /** Ends the measurement. */
  private readonly close = h("button", { type: "button", class: "small" });
  private isBegun = false;
  private takesPoints = true;
  /** The point under the crosshair; null if no key moves the view. */
  private aim: Point3 | null = null;
  private readonly listeners: (() => void)[] = [];
  private asked: { text: string; answer: (line: [Point3, Point3] | null) => void } | null = null;

  constructor(signal: AbortSignal) {
    this.element.append(this.text, this.close);
    this.button.addEventListener("click", () => this.set(!this.isBegun));
    this.close.addEventListener("click", () => this.end());
    addEventListener("keydown", (event) => {
      if (event.key !== "Escape" || !this.isBegun || isAsking()) return;
      this.end();
      // The next Escape closes the card.
      event.preventDefault();
    }, { signal });
    signal.addEventListener("abort", () => this.asked?.answer(null));
  }

  /** Calls back when the measurement begins or ends, and after each point. */
  onChange(listen: () => void): void {
    this.listeners.push(listen);
  }

  get isOn(): boolean {
    return this.isBegun;
  }

  /** True if the points are for a line that the page asked for. */
  get isAsked(): boolean {
    return this.asked !== null;
  }

  /** Asks for a line of two points; null if the person gives up. */
  line(text: string): Promise<[Point3, Point3] | null> {
    this.end();
    return new Promise((answer) => {
      this.asked = { text, answer };
      this.set(true);
    });
  }

  end(): void {
    if (this.isBegun) this.set(false);
  }

  /** False while points of the map are missing: a measurement would go through them to the floor. */
  set isReady(isReady: boolean) {
    this.takesPoints = isReady;
    if (this.isBegun) this.tell();
  }

  /** Takes a point, if one is measured. */
  take(point: Point3 | null): boolean {
    if (!this.isBegun) return false;
    if (!this.takesPoints) return true;
    if (point) this.ends = this.ends.length === 1 ? [...this.ends, point] : [point];
    const [from, to] = this.ends;
    if (from && to && this.asked) {
      this.asked.answer([from, to]);
      this.asked = null;
      this.set(false);
    } else {
      this.draw();
    }
    return true;
  }

  /** Drops the point that was taken last. */
  back(): void {
    this.ends = this.ends.slice(0, -1);
    this.draw();
  }

  /** Tells the point that the next Enter takes. */
  aimAt(point: Point3 | null): void {
    this.aim = point;
    if (this.isBegun) this.tell();
  }

  private set(isOn: boolean): void {
    this.isBegun = isOn;
    this.ends = [];
    this.aim = null;
    if (!isOn) {
      this.asked?.answer(null);
      this.asked = null;
    }
    this.button.setAttribute("aria-pressed", String(isOn));
    this.draw();
  }

  private draw(): void {
    this.element.hidden = !this.isBegun;
    this.close.textContent = this.asked ? "Cancel" : "Done";
    this.tell();
    for (const listen of this.listeners) listen();
  }

  private tell(): void {
    const prompt = this.asked?.text ?? "Tap or click two points.";
    const text = this.takesPoints ? progress(this.ends, this.aim, prompt) : "Measuring waits until all points are loaded.";
    if (this.text.textContent !== text) this.text.textContent = text;
  }
}

/** The state of a measurement in words; `prompt` asks for the first point. */
export function progress([from, to]: readonly Point3[], aim: Point3 | null, prompt: string): string {
  if (from && to) return between(from, to);
  if (!from) return aim ? `${prompt} Enter takes ${place(aim)}.` : prompt;
  return aim
    ? `${between(from, aim)} to ${place(aim)}. Enter takes the point, Backspace drops the first one.`
    : "Tap or click the second point.";
}

function place([x, y, z]: Point3): string {
  const height = Math.abs(z) < 0.02 ? "" : `, z ${decimal(z, 2)} m`;
  return `x ${decimal(x, 2)} m, y ${decimal(y, 2)} m${height}`;
}

/** `2.43 m (2.40 m along the floor, 38.0 cm up)` */
export function between([x1, y1, z1]: Point3, [x2, y2, z2]: Point3): string {
  const [flat, up] = [Math.hypot(x2 - x1, y2 - y1), z2 - z1];
  const whole = metres(Math.hypot(flat, up));
  if (Math.abs(up) < 0.02) return whole;
  return `${whole} (${metres(flat)} along the floor, ${metres(Math.abs(up))} ${up > 0 ? "up" : "down"})`;
}
