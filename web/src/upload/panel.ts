// The places to drop files on, and the queue of the home's uploads.

import { h } from "../dom.ts";
import { ask } from "../parts/dialog.ts";
import { bytes } from "../words.ts";
import { type Kind, kindOf } from "./kind.ts";
import { queueOf } from "./queue.ts";

export class UploadPanel {
  readonly element: HTMLElement;
  private readonly add: (file: File, kind: Kind) => void;

  constructor(
    home: string,
    /** The level that a LiDAR map is put for. */
    level: () => string,
    onDone: () => void,
    private readonly signal: AbortSignal,
  ) {
    const queue = queueOf(home);
    queue.onDone = onDone;
    this.add = (file, kind) => queue.add(file, kind, level());
    this.element = h("div", { class: "upload" }, this.target("clip"), this.target("map"), queue.list, queue.said);
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
}
