// A file in the list of uploads.

import { h } from "../dom.ts";
import { bytes, percent } from "../words.ts";

/** Gives the focus of a row that is gone to the field that adds clips: a person with keys would begin at the top of the page. */
export function focusOnAdding(): void {
  document.querySelector<HTMLElement>("#choose-clip")?.focus({ preventScroll: true });
}

export class UploadRow {
  readonly element: HTMLElement;
  private readonly bar: HTMLProgressElement;
  private readonly close: HTMLButtonElement;
  private readonly hint = h("span", { class: "hint" });
  /** The reason of a failure, and the button to try again. */
  private failure: HTMLElement[] = [];

  constructor(
    private readonly file: File,
    kind: string,
    onCancel: () => void,
  ) {
    const { name } = file;
    this.bar = h("progress", { max: 1, value: 0, "aria-label": `Upload of ${name}` });
    this.close = h("button", { type: "button", class: "quiet icon", "aria-label": `Cancel ${name}` }, "✕");
    this.close.addEventListener("click", onCancel);
    this.element = h("li", {},
      h("span", { class: "kind" }, kind), h("span", { class: "file", title: name, dir: "auto" }, name), this.hint, this.close, this.bar);
    this.wait("waits");
  }

  remove(): void {
    const hadFocus = this.element.contains(document.activeElement);
    this.element.remove();
    if (hadFocus) focusOnAdding();
  }

  /** Shows why the upload waits. */
  wait(reason: string): void {
    this.clear();
    this.bar.hidden = this.bar.value === 0;
    this.hint.textContent = reason;
  }

  /** Shows how much of the file is sent. */
  progress(sent_bytes: number): void {
    const share = this.file.size > 0 ? sent_bytes / this.file.size : 0;
    this.bar.hidden = false;
    this.bar.value = share;
    this.hint.textContent = share < 1 ? `${percent(share)} of ${bytes(this.file.size)}` : "is being read";
  }

  /** Shows the reason of a failure, and the service's own words if the reason has others; `onAgain` is null if another attempt cannot help. */
  fail(reason: string, onAgain: (() => void) | null, detail: string | null = null): void {
    this.clear();
    this.element.className = "failed";
    this.hint.hidden = this.bar.hidden = true;
    const again = onAgain && h("button", { type: "button", class: "small", onclick: onAgain }, "Try again");
    const more = detail && h("details", { class: "technical" }, h("summary", {}, "The service's own words"), h("p", { class: "hint" }, detail));
    this.failure = [h("p", { class: "reason", role: "alert" }, reason), ...(more ? [more] : []), ...(again ? [again] : [])];
    this.element.append(...this.failure);
  }

  private clear(): void {
    const hadFocus = this.failure.some((part) => part.contains(document.activeElement));
    this.element.className = "";
    this.hint.hidden = false;
    for (const part of this.failure) part.remove();
    this.failure = [];
    if (hadFocus) this.close.focus({ preventScroll: true });
  }
}
