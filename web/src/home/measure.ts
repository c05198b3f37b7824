// Measures between two points of the home, and lends its clicks to whoever asks for a line.

import type { Point3 } from "../cloud/pick.ts";
import { h } from "../dom.ts";
import { metres } from "../words.ts";

export class Measure {
  readonly element = h("p", { class: "measure", role: "status", hidden: true });
  readonly button = h("button", { type: "button", class: "tool", "aria-pressed": "false" }, "Measure");
  /** The ends that were clicked: none, one or two. */
  ends: Point3[] = [];
  private isOn = false;
  private asked: { text: string; answer: (line: [Point3, Point3] | null) => void } | null = null;

  constructor(
    private readonly onChange: () => void,
    signal: AbortSignal,
  ) {
    this.button.addEventListener("click", () => this.set(!this.isOn));
    addEventListener("keydown", (event) => {
      if (event.key === "Escape" && this.isOn) this.set(false);
    }, { signal });
    signal.addEventListener("abort", () => this.asked?.answer(null));
  }

  /** Asks for a line of two points; null if the person gives up. */
  line(text: string): Promise<[Point3, Point3] | null> {
    this.set(false);
    return new Promise((answer) => {
      this.asked = { text, answer };
      this.set(true);
    });
  }

  /** Takes a click, if it is for a measurement. */
  take(point: Point3 | null): boolean {
    if (!this.isOn) return false;
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

  private set(isOn: boolean): void {
    this.isOn = isOn;
    this.ends = [];
    if (!isOn) {
      this.asked?.answer(null);
      this.asked = null;
    }
    this.button.setAttribute("aria-pressed", String(isOn));
    this.draw();
  }

  private draw(): void {
    const [from, to] = this.ends;
    this.element.hidden = !this.isOn;
    this.element.textContent = from && to ? between(from, to)
      : from ? "Click the second point." : (this.asked?.text ?? "Click two points. Escape ends.");
    this.onChange();
  }
}

/** `2.43 m (2.40 m along the floor, 38.0 cm up)` */
export function between([x1, y1, z1]: Point3, [x2, y2, z2]: Point3): string {
  const [flat, up] = [Math.hypot(x2 - x1, y2 - y1), z2 - z1];
  const whole = metres(Math.hypot(flat, up));
  if (Math.abs(up) < 0.02) return whole;
  return `${whole} (${metres(flat)} along the floor, ${metres(Math.abs(up))} ${up > 0 ? "up" : "down"})`;
}
