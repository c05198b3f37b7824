// The drop area, and the progress of each upload.

import { homePath } from "../api.ts";
import { h } from "../dom.ts";
import { ask } from "../parts/dialog.ts";
import { messageOf } from "../parts/notices.ts";
import { bytes, percent } from "../words.ts";
import { type Kind, kindOf } from "./kind.ts";
import { send } from "./send.ts";

interface Upload {
  file: File;
  kind: Kind;
  row: HTMLElement;
  bar: HTMLProgressElement;
  word: HTMLElement;
  stop: AbortController;
}

const WORDS: Record<Kind, string> = { clip: "Clip", map: "LiDAR map" };

export class UploadPanel {
  readonly element: HTMLElement;
  private readonly list = h("ul", { class: "uploads", "aria-label": "Uploads" });
  private readonly said = h("p", { class: "hidden-text", role: "status", "aria-live": "polite" });
  private waiting: Upload[] = [];
  private isSending = false;

  constructor(
    private readonly home: string,
    /** The level that a LiDAR map is put for. */
    private readonly level: () => string,
    private readonly onDone: (kind: Kind) => void,
    private readonly signal: AbortSignal,
  ) {
    this.element = h("div", { class: "upload" }, this.target("clip"), this.target("map"), this.list, this.said);
    this.takeDrops();
  }

  /** A button that opens the file chooser, and a place to drop on that needs no guess. */
  private target(kind: Kind): HTMLElement {
    const input = h("input", {
      type: "file", multiple: kind === "clip", class: "hidden-text", id: `choose-${kind}`, "data-kind": kind,
    });
    const hint = kind === "clip" ? "zip, .r3d, .db or .mcap of an RGB-D recording" : "Valetudo, a robot's file, ROS zip, PLY, PCD, CSV";
    const label = h(
      "label", { class: "drop", for: input.id, "data-kind": kind },
      h("strong", {}, kind === "clip" ? "Add clips" : "Put LiDAR map"), h("span", { class: "hint" }, hint),
    );
    input.addEventListener("change", () => {
      for (const file of input.files ?? []) void this.sort(file, kind);
      input.value = "";
    });
    return h("div", { class: "target" }, input, label);
  }

  /** Files may be dropped anywhere on the page. */
  private takeDrops(): void {
    const options = { signal: this.signal };
    const page = document.documentElement;
    const isFiles = (event: DragEvent) => event.dataTransfer?.types.includes("Files") ?? false;
    addEventListener("dragover", (event) => {
      if (!isFiles(event)) return;
      event.preventDefault();
      page.classList.add("dropping");
    }, options);
    addEventListener("dragleave", (event) => event.relatedTarget || page.classList.remove("dropping"), options);
    addEventListener("drop", (event) => {
      page.classList.remove("dropping");
      if (!isFiles(event)) return;
      event.preventDefault();
      const target = event.target instanceof Element ? event.target.closest<HTMLElement>("[data-kind]") : null;
      const said = target?.dataset.kind as Kind | undefined;
      for (const file of event.dataTransfer?.files ?? []) void this.sort(file, said);
    }, options);
  }

  private async sort(file: File, said: Kind | undefined): Promise<void> {
    const found = await kindOf(file).catch(() => null);
    const isOther = said && found && said !== found;
    const kind = isOther ? await this.askOther(file, said, found) : (said ?? found ?? (await this.askKind(file)));
    if (kind) this.add(file, kind);
  }

  /** A file on the place of the other kind, for example a map on "Add clips". */
  private askOther(file: File, said: Kind, found: Kind): Promise<Kind | null> {
    const word = (kind: Kind) => (kind === "clip" ? "clip" : "LiDAR map");
    return ask(`A ${word(found)}?`, `${file.name} looks like a ${word(found)}, not like a ${word(said)}.`, [
      { word: `Use it as a ${word(found)}`, value: found, kind: "primary" },
      { word: `Use it as a ${word(said)}`, value: said },
      { word: "Cancel", value: null },
    ]);
  }

  private askKind(file: File): Promise<Kind | null> {
    return ask("What is this file?", `${file.name} (${bytes(file.size)}) may be a clip or a LiDAR map.`, [
      { word: "A clip", value: "clip", kind: "primary" },
      { word: "A LiDAR map", value: "map" },
      { word: "Neither", value: null },
    ]);
  }

  private add(file: File, kind: Kind): void {
    const bar = h("progress", { max: 1, value: 0, "aria-label": `Upload of ${file.name}` });
    const word = h("span", { class: "hint" }, "waits");
    const close = h("button", { type: "button", class: "quiet icon", "aria-label": `Cancel ${file.name}` }, "✕");
    const title = h("span", { class: "file" }, file.name);
    const row = h("li", {}, h("span", { class: "kind" }, WORDS[kind]), title, word, close, bar);
    const upload: Upload = { file, kind, row, bar, word, stop: new AbortController() };
    close.addEventListener("click", () => {
      upload.stop.abort();
      this.waiting = this.waiting.filter((other) => other !== upload);
      row.remove();
    });
    this.list.append(row);
    // Clips wait for a map anyway, so that the map goes first.
    this.waiting = kind === "map" ? [upload, ...this.waiting] : [...this.waiting, upload];
    void this.work();
  }

  /** One at a time: two would only share the same line. */
  private async work(): Promise<void> {
    if (this.isSending) return;
    this.isSending = true;
    for (let upload = this.waiting.shift(); upload; upload = this.waiting.shift()) await this.sendOne(upload);
    this.isSending = false;
  }

  private async sendOne({ file, kind, row, bar, word, stop }: Upload): Promise<void> {
    const onSent = (share: number) => {
      bar.value = share;
      word.textContent = share < 1 ? `${percent(share)} of ${bytes(file.size)}` : "being read";
    };
    onSent(0);
    try {
      const [method, path] = kind === "clip"
        ? (["POST", homePath(this.home, "clips")] as const)
        : (["PUT", homePath(this.home, "lidar-maps", encodeURIComponent(this.level()))] as const);
      await send(method, path, file, onSent, stop.signal);
      this.said.textContent = `${file.name} is stored.`;
      row.remove();
      this.onDone(kind);
    } catch (error) {
      if (stop.signal.aborted) return;
      row.classList.add("failed");
      bar.remove();
      word.remove();
      row.append(h("p", { class: "reason", role: "alert" }, messageOf(error)));
    }
  }
}
