// Lists the uploads that a reload or a closed tab interrupted, and resumes them: the page has no right to read a file again by itself.

import * as api from "../api.ts";
import { h, putAgain } from "../dom.ts";
import { isLocked } from "../parts/locks.ts";
import { alarm } from "../parts/notices.ts";
import { bytes, many, named, percent } from "../words.ts";
import { begunIn, dropBegun, type Known } from "./begun.ts";
import { lockOf, type UploadQueue } from "./queue.ts";
import { focusOnAdding } from "./row.ts";
import { forgetClip } from "./tus.ts";

type Begun = ReturnType<typeof begunIn>[number];

/** An interrupted upload; `received_bytes` is null if the service did not answer. */
interface Interrupted {
  begun: Begun;
  received_bytes: number | null;
}

export class Unfinished {
  readonly element = h("ul", { class: "unfinished", "aria-label": "Unfinished uploads", hidden: true });
  readonly said = h("p", { class: "hidden-text", role: "status" });
  /** Counts the readings: an earlier one that comes late shows nothing. */
  private readings = 0;

  constructor(
    private readonly home: string,
    private readonly queue: UploadQueue,
    private readonly signal: AbortSignal,
  ) {}

  /** Asks the service what it has of the uploads that no tab sends. */
  async draw(): Promise<void> {
    const reading = ++this.readings;
    const found = await Promise.all(begunIn(this.home).map((begun) => this.ask(begun)));
    if (reading !== this.readings || this.signal.aborted) return;
    const shown = found.flatMap((one) => (one && !this.queue.has(one.begun.key) ? [one] : []));
    const hadFocus = this.element.contains(document.activeElement);
    this.element.hidden = shown.length === 0;
    putAgain(this.element, ...shown.map((one) => this.row(one)));
    if (hadFocus && !this.element.contains(document.activeElement)) focusOnAdding();
    this.said.textContent = shown.length > 0 ? `${many(shown.length, "upload")} ${shown.length === 1 ? "is" : "are"} not finished.` : "";
  }

  /** Null for an upload that needs no file: it is sent by a tab, complete, or gone. */
  private async ask(begun: Begun): Promise<Interrupted | null> {
    if (this.queue.has(begun.key) || begun.path === null || (await isLocked(lockOf(begun)))) return null;
    try {
      const upload = await api.upload(begun.path, this.signal);
      if (upload?.state === "arriving") return { begun, received_bytes: upload.received_bytes };
      if (upload?.state !== "arrived") dropBegun(begun);
      // The tab that sent it was closed before the service had read it, so nobody was told.
      if (upload?.problem) {
        alarm(`${named(begun.file.name)} is not stored: ${api.explanation(upload.problem.status, JSON.stringify(upload.problem))}`);
      }
      return null;
    } catch {
      return { begun, received_bytes: null };
    }
  }

  private row({ begun, received_bytes }: Interrupted): HTMLElement {
    const { file, key } = begun;
    const name = `Choose the file ${file.name} again`;
    const input = h("input", { type: "file", class: "hidden-text", id: `continue-${key}`, "aria-label": name, "data-key": key });
    input.addEventListener("change", () => {
      const [chosen] = input.files ?? [];
      input.value = "";
      if (chosen) this.resume(file, chosen);
    });
    const drop = h("button", { type: "button", class: "quiet icon", "aria-label": `Discard ${file.name}`, "data-key": `discard ${key}` }, "✕");
    drop.addEventListener("click", () => {
      dropBegun(begun);
      forgetClip(begun);
      void this.draw();
    });
    const share = received_bytes === null ? "" : ` ${percent(received_bytes / file.size)} of ${bytes(file.size)} has arrived.`;
    return h("li", {},
      h("span", { class: "file", title: file.name, dir: "auto" }, file.name), drop,
      h("p", { class: "hint" }, `The upload was interrupted.${share} Choose the same file to continue.`),
      h("div", { class: "target" }, input, h("label", { class: "button", for: input.id }, "Choose the file")));
  }

  private resume(file: Known, chosen: File): void {
    const isSame = file.name === chosen.name && file.size === chosen.size && file.lastModified === chosen.lastModified;
    if (isSame) this.queue.addClip(chosen);
    else alarm(`${named(chosen.name)} is another file, or was changed since. Choose ${named(file.name)}, or add this one with “Add clips”.`);
    void this.draw();
  }
}
