// Lists the rooms and objects of a home. A person searches in it and selects.

import { h, isByKey, put, putAgain } from "../dom.ts";
import { area } from "../words.ts";
import type { HomeData } from "./data.ts";
import type { Looks } from "./looks.ts";
import { isSame, roomName, type Selection, sureOf, thingName } from "./selection.ts";
import { synonymsOf } from "./synonyms.ts";

/** Classes that belong to the walls; they come last. */
const OF_WALLS = new Set(["door", "window", "curtain", "mirror", "picture", "radiator", "stairs"]);
const GROUPS = ["Rooms", "Objects", "On the walls"] as const;

interface Entry {
  group: (typeof GROUPS)[number];
  selection: Selection;
  name: string;
  note: string;
  colour: string | null;
  /** Of a room; 0 for an object. */
  area_m2: number;
  /** A search finds it by beginnings of these words, and by whole words of its room's name. */
  words: string[];
  ofRoom: string[];
}

export class ThingsPanel {
  readonly element: HTMLElement;
  private readonly search = h("input", {
    type: "search", placeholder: "Search rooms and objects", "aria-label": "Search rooms and objects", dir: "auto",
  });
  private readonly list = h("ul", { class: "things" });
  private drawn = "";
  /** The selection when the list was drawn. */
  private picked: Selection | null = null;

  constructor(
    private readonly data: HomeData,
    private readonly looks: Looks,
    private readonly onChosen: (selection: Selection, isByKey: boolean) => void,
  ) {
    this.search.addEventListener("input", () => this.draw());
    this.element = h("div", {}, this.search, this.list);
    looks.onChange(() => this.draw());
    this.draw();
  }

  draw(): void {
    const all = this.entries();
    const wanted = wordsOf(this.search.value);
    const shown = all.filter(({ words, ofRoom }) =>
      wanted.every((word) => words.some((own) => own.startsWith(word)) || ofRoom.includes(word)));
    const drawn = JSON.stringify([shown, this.looks.selected, all.length > 0, this.data.described !== ""]);
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    this.search.hidden = all.length === 0;
    if (all.length === 0) put(this.list, h("li", { class: "hint" }, this.data.described
      ? "No room and no object is known on this level." : "Rooms and objects appear when a clip has its place."));
    else if (shown.length === 0) put(this.list, h("li", { class: "hint" }, "Nothing here has this name. Try another word, or a room."));
    else putAgain(this.list, ...GROUPS.flatMap((group) => this.part(group, shown.filter((entry) => entry.group === group))),
      !this.data.described && h("li", { class: "hint" }, "Objects appear when a clip has its place."));
    if (!isSame(this.picked, this.looks.selected)) this.bringIntoSight();
    this.picked = this.looks.selected;
  }

  /** Scrolls the list, and not the page, to the selected row. */
  private bringIntoSight(): void {
    const row = this.list.querySelector("[aria-pressed=true]")?.getBoundingClientRect();
    const list = this.list.getBoundingClientRect();
    if (!row || (row.top >= list.top && row.bottom <= list.bottom)) return;
    this.list.scrollTop += row.top - list.top - (list.height - row.height) / 2;
  }

  private entries(): Entry[] {
    const { data } = this;
    const roomNames = new Map(data.rooms.map((room) => [room.id, roomName(room)]));
    const known = data.rooms.length > 0 ? data.rooms : data.robotRooms;
    const rooms = known.map((room): Entry => {
      const name = roomName(room);
      const note = area(room.area_m2);
      const words = wordsOf(`${name} room ${room.id}`);
      return {
        group: "Rooms", selection: { kind: "room", id: room.id }, name, note, colour: null, area_m2: room.area_m2, words, ofRoom: [],
      };
    });
    const things = data.things.map((thing): Entry => {
      const [name, room] = [thingName(thing), thing.room ? (roomNames.get(thing.room) ?? "") : ""];
      const note = [room, sureOf(thing)].filter(Boolean).join(" · ");
      const words = wordsOf(`${name} ${thing.class.replaceAll("_", " ")} ${synonymsOf(thing.class)} ${thing.id}`);
      const colour = data.classNamed(thing.class)?.color ?? "#9a9a9a";
      const group = OF_WALLS.has(thing.class) ? "On the walls" : "Objects";
      const selection: Selection = { kind: "object", id: thing.id };
      return { group, selection, name, note, colour, area_m2: 0, words, ofRoom: wordsOf(room) };
    });
    // The number orders rooms of one name: "Bedroom 10" is after "Bedroom 9".
    const byName = (a: Entry, b: Entry) => a.name.localeCompare(b.name, undefined, { numeric: true });
    return [...rooms.sort(byName), ...things.sort(byName)];
  }

  private part(group: string, entries: Entry[]): HTMLElement[] {
    if (entries.length === 0) return [];
    const area_m2 = entries.reduce((sum, entry) => sum + entry.area_m2, 0);
    const title = area_m2 > 0 ? `${group} · ${area(area_m2)}` : group;
    return [h("li", { class: "group" }, title), ...entries.map((entry) => this.row(entry))];
  }

  private row({ selection, name, note, colour }: Entry): HTMLElement {
    const swatch = h("span", { class: colour ? "swatch" : "swatch room" });
    if (colour) swatch.style.background = colour;
    const button = h("button", {
      type: "button", class: "thing-row", "data-key": `${selection.kind} ${selection.id}`,
      "aria-pressed": String(isSame(selection, this.looks.selected)),
    }, swatch, h("span", { class: "word", dir: "auto" }, name), h("span", { class: "hint" }, h("bdi", {}, note)));
    button.addEventListener("click", (event) => this.onChosen(selection, isByKey(event)));
    return h("li", {}, button);
  }
}

function wordsOf(text: string): string[] {
  return text.toLowerCase().split(/\s+/).filter(Boolean);
}
