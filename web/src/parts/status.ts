// A line that shows every step of a progress. Screen readers hear its start and its end, not each figure between.

import { h } from "../dom.ts";

export class StatusLine {
  readonly shown: HTMLElement;
  readonly said = h("p", { class: "hidden-text", role: "status" });
  private step = "";

  constructor(kind: string) {
    this.shown = h("p", { class: kind, "aria-hidden": "true" });
  }

  /** Shows an error, until the next text. */
  fail(text: string): void {
    this.show(text);
    this.shown.classList.add("bad");
  }

  show(text: string): void {
    this.shown.classList.remove("bad");
    this.shown.textContent = text;
    const step = text.replace(/\d/g, "");
    if (step === this.step) return;
    this.step = step;
    this.said.textContent = text;
  }
}
