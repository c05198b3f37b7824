// The places to drop files on, and the queue of the home's uploads.

import { lidarMaps } from "../api.ts";
import { h } from "../dom.ts";
import type { HomeData } from "../home/data.ts";
import { ask } from "../parts/dialog.ts";
import { alarm, say, tellFailure } from "../parts/notices.ts";
import { mayChange } from "../session.ts";
import { bytes, named } from "../words.ts";
import { explainFiles, explainRefused, type Refused } from "./help.ts";
import { isKind, type Kind, kindOf } from "./kind.ts";
import { askTarget } from "./level.ts";
import { queueOf } from "./queue.ts";
import { Unfinished } from "./unfinished.ts";

export class UploadPanel {
  readonly element: HTMLElement;
  private readonly queue: ReturnType<typeof queueOf>;
  private readonly unfinished: Unfinished;
  /** Files are sorted one after another, so that one question is open at a time. */
  private sorted = Promise.resolve();

  constructor(
    private readonly data: HomeData,
    onDone: () => void,
    private readonly signal: AbortSignal,
  ) {
    const queue = queueOf(data.home.id);
    this.queue = queue;
    queue.onDone = onDone;
    signal.addEventListener("abort", () => queue.leavePage());
    this.unfinished = new Unfinished(data.home.id, queue, signal);
    this.element = h("div", { class: "upload" }, this.target("clip"), this.target("map"), help(),
      this.unfinished.element, queue.list, queue.said, this.unfinished.said);
    void this.unfinished.draw();
    this.takeDrops();
  }

  /** A button that opens the file chooser, and a place to drop on that needs no guess. */
  private target(kind: Kind): HTMLElement {
    const input = h("input", {
      type: "file", multiple: kind === "clip", class: "hidden-text", id: `choose-${kind}`, "data-kind": kind,
    });
    const hint = kind === "clip" ? "recordings with depth: .zip, .r3d, .db, .mcap" : "Valetudo, a robot's file, ROS zip, PLY, PCD, CSV";
    const label = h(
      "label", { class: "drop", for: input.id, "data-kind": kind },
      h("strong", {}, kind === "clip" ? "Add clips" : "Add LiDAR map"), h("span", { class: "hint" }, hint),
    );
    input.addEventListener("change", () => {
      this.take([...(input.files ?? [])], kind);
      input.value = "";
    });
    return h("div", { class: "target" }, input, label);
  }

  /** Files may be dropped anywhere on the page. */
  private takeDrops(): void {
    // Before `refuseDrops`.
    const options = { signal: this.signal, capture: true };
    const page = document.documentElement;
    addEventListener("dragover", (event) => {
      if (!hasFiles(event)) return;
      event.preventDefault();
      page.classList.add("dropping");
    }, options);
    addEventListener("dragleave", (event) => event.relatedTarget || page.classList.remove("dropping"), options);
    addEventListener("drop", (event) => {
      page.classList.remove("dropping");
      if (!hasFiles(event)) return;
      event.preventDefault();
      const target = event.target instanceof Element ? event.target.closest<HTMLElement>("[data-kind]") : null;
      const said = target?.dataset.kind as Kind | undefined;
      this.take(filesOf(event.dataTransfer), said);
    }, options);
  }

  private take(files: File[], said: Kind | undefined): void {
    this.sorted = this.sorted.then(() => this.sortAll(files, said)).catch((error: unknown) => void tellFailure(error));
  }

  private async sortAll(files: File[], said: Kind | undefined): Promise<void> {
    const refused: Refused[] = [];
    for (const file of files) {
      const found = await kindOf(file).catch(() => null);
      // The page ended while other files were asked for.
      if (this.signal.aborted) return;
      if (found === null || isKind(found)) await this.sort(file, said, found);
      else refused.push({ name: file.name, kind: found });
    }
    // One question for all of them: a person may have chosen a whole album.
    if (!this.signal.aborted) await explainRefused(refused, said);
  }

  private async sort(file: File, said: Kind | undefined, found: Kind | null): Promise<void> {
    const isOther = said && found && said !== found;
    const kind = isOther ? await this.askOther(file, said, found) : (said ?? found ?? (await this.askKind(file)));
    if (kind === "clip") {
      this.queue.addClip(file);
      void this.unfinished.draw();
    }
    if (kind === "map") await this.addMap(file);
  }

  /** The map of the shown level; asks first if the level has one. The page may not have read the newest map yet. */
  private async addMap(file: File): Promise<void> {
    const { data: { home, level, lidars }, queue, signal } = this;
    const { levels } = queue;
    const maps = await lidarMaps(home.id, signal).catch(() => lidars);
    if (signal.aborted) return;
    const taken = [...new Set([...levels, ...maps.map((map) => map.level)])];
    const now = { level, replaces: maps.find((map) => map.level === level)?.revision ?? null };
    const target = taken.includes(level) ? await askTarget(file, now, taken) : now;
    if (target) queue.addMap(file, target);
  }

  /** A file on the place of the other kind, for example a map on "Add clips". */
  private askOther(file: File, said: Kind, found: Kind): Promise<Kind | null> {
    const word = (kind: Kind) => (kind === "clip" ? "clip" : "LiDAR map");
    return ask(`A ${word(found)}?`, `${named(file.name)} looks like a ${word(found)}, not like a ${word(said)}.`, [
      { word: `Use it as a ${word(found)}`, value: found, kind: "primary" },
      { word: `Use it as a ${word(said)}`, value: said },
      { word: "Cancel", value: null },
    ]);
  }

  private askKind(file: File): Promise<Kind | null> {
    return ask("What is this file?", `${named(file.name)} (${bytes(file.size)}) may be a clip or a LiDAR map.`, [
      { word: "A clip", value: "clip", kind: "primary" },
      { word: "A LiDAR map", value: "map" },
      { word: "Neither", value: null },
    ]);
  }
}

function help(): HTMLElement {
  return h("button", { type: "button", class: "link help", onclick: () => void explainFiles() }, "Which files, and how do I get them?");
}

/** Keeps the browser from opening a file that is dropped where no panel takes it. */
export function refuseDrops(): void {
  addEventListener("dragover", (event) => hasFiles(event) && event.preventDefault());
  addEventListener("drop", (event) => {
    if (!hasFiles(event) || event.defaultPrevented) return;
    event.preventDefault();
    say(mayChange() ? "Open a home to add files." : "This key cannot add files.");
  });
}

function hasFiles(event: DragEvent): boolean {
  return event.dataTransfer?.types.includes("Files") ?? false;
}

/** The files of a drop. A folder has no bytes to send: an alarm names it. */
function filesOf(dropped: DataTransfer | null): File[] {
  const files = [];
  for (const item of dropped?.items ?? []) {
    const file = item.getAsFile();
    if (item.webkitGetAsEntry()?.isDirectory) alarm(`${file ? named(file.name) : "This"} is a folder; drop its zip archive.`);
    else if (file) files.push(file);
  }
  return files;
}
