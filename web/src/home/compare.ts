// Shows the changes of objects between two revisions of the map.

import * as api from "../api.ts";
import { h, isByKey, put, putAgain } from "../dom.ts";
import { messageOf } from "../parts/notices.ts";
import type { MapChanges, Thing } from "../types.ts";
import { levelWord, many, metres, plain, time } from "../words.ts";
import type { HomeData } from "./data.ts";
import { roomName, type Selection, thingName } from "./selection.ts";

const REASON_WORDS: Record<string, string> = {
  seen_again: "a later clip shows the place without it",
  hidden: "a person removed it",
  clips_removed: "its clips were removed",
  not_found: "it is not recognised",
};

export class Compare {
  readonly element = h("div", { class: "compare" });
  private readonly from = h("select", { "aria-label": "Compare with" });
  private readonly result = h("div", { role: "status" });
  /** The newest revision; 0 without a map. */
  private revision = 0;
  /** The revision that a person chose to compare with; without one, it is the newest earlier one. */
  private chosen = "";
  /** The revision and the level that the panel was drawn for. */
  private drawn = "";

  constructor(
    private readonly data: HomeData,
    private readonly onChosen: (selection: Selection, isByKey: boolean) => void,
    private readonly signal: AbortSignal,
  ) {
    this.from.addEventListener("change", () => {
      this.chosen = this.from.value;
      void this.compare();
    });
    this.element.append(h("label", { class: "row" }, "Since", this.from), this.result);
  }

  /** Reads the revisions again if the map has a new one, or another level is shown; the panel must be open for that. */
  async draw(): Promise<void> {
    const revision = this.data.map?.revision ?? 0;
    const drawn = [revision, this.data.level, this.data.described].join(" ");
    if (drawn === this.drawn || !this.element.isConnected || this.element.closest("details")?.open === false) return;
    this.drawn = drawn;
    try {
      const all = revision ? await api.revisions(this.data.home.id, this.signal) : [];
      if (drawn !== this.drawn) return;
      this.revision = revision;
      const earlier = all.filter((other) => other.revision < revision);
      put(this.from, ...earlier.map((map) =>
        h("option", { value: map.revision }, `map ${map.revision}, ${time(map.created_at)}`)));
      if (earlier.some((map) => String(map.revision) === this.chosen)) this.from.value = this.chosen;
      this.from.disabled = earlier.length === 0;
      if (earlier.length === 0) put(this.result, h("p", { class: "hint" }, "There is no earlier map to compare with."));
      else await this.compare();
    } catch (error) {
      if (drawn === this.drawn) this.tell(error);
    }
  }

  /** Shows why nothing can be compared. The next change of the home tries again. */
  private tell(error: unknown): void {
    if (this.signal.aborted) return;
    this.drawn = "";
    put(this.result, h("p", { class: "reason" }, messageOf(error)));
  }

  private async compare(): Promise<void> {
    const { revision } = this;
    const from = Number(this.from.value);
    if (!from) return;
    // A person may have chosen another revision meanwhile.
    const isOld = () => from !== Number(this.from.value) || revision !== this.revision;
    try {
      const changes = await api.changes(this.data.home.id, from, revision, this.signal);
      if (!isOld()) this.show(changes);
    } catch (error) {
      if (!isOld()) this.tell(error);
    }
  }

  private show(changes: MapChanges): void {
    const { added, discovered, found_again, moved, gone, lost } = changes;
    if ([added, discovered, found_again, moved, gone, lost].every((list) => list.length === 0)) {
      return putAgain(this.result, h("p", { class: "hint" }, "No object was added, moved or removed."));
    }
    putAgain(this.result, ...this.lists(changes));
  }

  private lists({ added, discovered, found_again, moved, gone, lost }: MapChanges): HTMLElement[] {
    const distance = (a: Thing, b: Thing) =>
      Math.hypot(a.centre_m[0] - b.centre_m[0], a.centre_m[1] - b.centre_m[1]);
    const list = (title: string, rows: HTMLElement[]) =>
      rows.length > 0 ? [h("h3", {}, title), h("ul", { class: "things" }, ...rows)] : [];
    const missing = ({ reason, object }: { reason: string; object: Thing }) =>
      h("li", { class: "gone" }, h("span", { class: "word", dir: "auto" }, thingName(object)),
        h("span", { class: "hint" }, REASON_WORDS[reason] ?? plain(reason).toLowerCase()));
    return [
      ...list(`${many(added.length, "object")} added`, added.map((thing) => this.row(thing, this.roomOf(thing)))),
      ...list(`${many(moved.length, "object")} moved`, moved.map(({ from, to }) =>
        this.row(to, `by ${metres(distance(from, to))}`))),
      ...list(`${many(gone.length, "object")} gone`, gone.map(missing)),
      ...list(`${many(discovered.length, "object")} seen for the first time`, discovered.map((thing) =>
        this.row(thing, this.roomOf(thing)))),
      ...list(`${many(found_again.length, "object")} found again`, found_again.map((thing) =>
        this.row(thing, this.roomOf(thing)))),
      ...list(`${many(lost.length, "object")} no longer known`, lost.map(missing)),
    ];
  }

  /** The name of the room of an object. Names of rooms on other levels are not read. */
  private roomOf({ room: id }: Thing): string {
    return id ? roomName(this.data.rooms.find((room) => room.id === id) ?? { name: null, id }) : "";
  }

  private row(thing: Thing, note: string): HTMLElement {
    // Only the objects of the level that is shown can be shown.
    const isHere = thing.level === this.data.level;
    const button = h("button", { type: "button", class: "thing-row", "data-key": `changed ${thing.id}`, disabled: !isHere },
      h("span", { class: "word", dir: "auto" }, thingName(thing)),
      h("span", { class: "hint" }, isHere ? note : [levelWord(thing.level), note].filter((word) => word).join(", ")));
    button.addEventListener("click", (event) => this.onChosen({ kind: "object", id: thing.id }, isByKey(event)));
    return h("li", {}, button);
  }
}
