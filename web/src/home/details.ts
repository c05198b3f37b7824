// The card of the selected object or room: its properties, and buttons that correct them.

import * as api from "../api.ts";
import { h, put, putAgain } from "../dom.ts";
import { ask, askText, isAsking } from "../parts/dialog.ts";
import { attempt, offer, say } from "../parts/notices.ts";
import { toClip } from "../route.ts";
import { mayChange } from "../session.ts";
import type { RobotRoom, Room, RoomPatch, Thing, ThingPatch } from "../types.ts";
import { area, decimal, named, percent, plain, time } from "../words.ts";
import type { HomeData } from "./data.ts";
import type { Looks } from "./looks.ts";
import type { Measure } from "./measure.ts";
import { isClassSet, robotRoomOf, roomName, roomOf, SET, thingName, thingOf } from "./selection.ts";

/** Rooms are neighbours if their outlines come this near to each other: a wall is between them. */
const NEIGHBOURS_M = 0.6;
/** Of the name of an object or a room. */
const MOST_LETTERS = 100;

export class Details {
  readonly element = h("section", { class: "details", "aria-live": "polite", "aria-labelledby": "details-name", tabindex: -1, hidden: true });
  private drawn = "";
  /** The row that a person used by keys to select; null if the selection came another way. */
  private opener: HTMLElement | null = null;
  /** The id of the room that a line was asked for. */
  private divided = "";

  constructor(
    private readonly data: HomeData,
    private readonly looks: Looks,
    private readonly measure: Measure,
    private readonly onCorrected: () => void,
    signal: AbortSignal,
  ) {
    looks.onChange(() => this.draw());
    measure.onChange(() => this.show());
    // From the row in the list, too.
    addEventListener("keydown", (event) => {
      const isOfOther = event.defaultPrevented || isAsking() || (event.target as HTMLElement).closest?.("input, select");
      if (event.key === "Escape" && !this.element.hidden && !isOfOther) this.close();
    }, { signal });
  }

  draw(): void {
    const { data, looks } = this;
    const [thing, room] = [thingOf(data, looks.selected), roomOf(data, looks.selected)];
    const robotRoom = robotRoomOf(data, looks.selected);
    const hadFocus = this.element.contains(document.activeElement);
    if (!hadFocus) this.opener = null;
    // A line that was asked for is of no use for another room.
    if (this.measure.isAsked && room?.id !== this.divided) this.measure.end();
    const drawn = JSON.stringify([thing, room, robotRoom, data.described, data.clips.length]);
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    this.show();
    if (thing) putAgain(this.element, ...this.ofThing(thing));
    else if (room) putAgain(this.element, ...this.ofRoom(room));
    else if (robotRoom) putAgain(this.element, ...this.ofRobotRoom(robotRoom));
    else put(this.element);
    // The button that had the focus may be gone.
    if (hadFocus && !this.element.contains(document.activeElement)) this.element.focus({ preventScroll: true });
  }

  /** Takes the focus of a person who selected by keys: the card is far from the lists. It goes back when the card closes. */
  focus(): void {
    const { activeElement } = document;
    if (this.element.hidden) return;
    this.opener = activeElement instanceof HTMLElement && activeElement !== document.body ? activeElement : null;
    this.element.focus({ preventScroll: true });
  }

  /** The card would hide the room that a person divides. */
  private show(): void {
    const { data, looks, measure } = this;
    const isChosen = [thingOf, roomOf, robotRoomOf].some((of) => of(data, looks.selected) !== null);
    this.element.hidden = !isChosen || measure.isAsked;
  }

  private head(name: string): HTMLElement {
    const close = h("button", { type: "button", class: "quiet icon", "aria-label": "Close", "data-key": "Close" }, "✕");
    close.addEventListener("click", () => this.close());
    return h("div", { class: "row between" }, h("h2", { id: "details-name", dir: "auto" }, name), close);
  }

  /** Closes the card. The focus goes to the row that opened it, to that of its object or room, or else to the map. */
  private close(isRemoved = false): void {
    const { opener, looks: { selected } } = this;
    const hadFocus = this.element.contains(document.activeElement);
    this.looks.select(null);
    if (!hadFocus || !selected) return;
    // Lists make their rows again. A removed object loses its row.
    const rowOf = (key: string | undefined) => document.querySelector(`.side [data-key="${CSS.escape(key ?? "")}"]`);
    const rows = isRemoved ? [] : [opener, rowOf(opener?.dataset.key), rowOf(`${selected.kind} ${selected.id}`)];
    const views = this.element.closest(".stage")?.querySelectorAll(".stage-3d canvas, .views > .plan") ?? [];
    const shown = [...rows, ...views].find((element) => element?.checkVisibility());
    (shown as HTMLElement | SVGElement | undefined)?.focus({ preventScroll: true });
  }

  private ofThing(thing: Thing): HTMLElement[] {
    const { data } = this;
    const room = data.rooms.find(({ id }) => id === thing.room);
    const clips = thing.clips.flatMap((id, i) => {
      const clip = data.clips.find((clip) => clip.id === id);
      const link = h("a", { href: toClip(data.home.id, id), "data-key": id, dir: "auto" }, clip ? data.nameOf(clip) : "a clip");
      return i > 0 ? [", ", link] : [link];
    });
    const facts: [string, Node | string][] = [
      ["Class", `${plain(thing.class)}, ${isClassSet(thing) ? SET : `${percent(thing.confidence)} sure`}`],
      ["Size", thing.size_m.map((side) => decimal(side, 2)).join(" × ") + " m"],
      ["Room", room ? this.linkTo(room) : "–"],
      ["Seen by", clips.length > 0 ? h("span", {}, ...clips) : "no clip of this map"],
    ];
    if (thing.last_seen) facts.push(["Last seen", time(thing.last_seen)]);
    if (thing.corrected.length > 0) facts.push(["Corrected", thing.corrected.map(fieldWord).join(", ")]);
    return [
      this.head(thingName(thing)), definitions(facts),
      h("div", { class: "row" },
        this.action("Rename", async () => {
          const name = await askText("Name of the object", thing.name ?? "", "Rename", MOST_LETTERS);
          if (name !== null) await this.correctThing(thing, { name: name || null }, nameTold(name));
        }),
        this.action("Change class", async () => {
          const chosen = await this.askClass(thing.class);
          if (chosen) await this.correctThing(thing, { class: chosen }, `It is a ${plain(chosen).toLowerCase()} now.`);
        }),
        thing.corrected.includes("pinned")
          ? this.action("Unpin", () => this.correctThing(thing, { pinned: null }, "Later clips can change it again."), "", "Pin")
          : this.action("Pin", () => this.correctThing(thing, { pinned: true }, "It stays, whatever later clips show.")),
        thing.corrected.length > 0 && this.action("Withdraw corrections", () => this.correctThing(
          thing, { class: null, name: null, centre_m: null, size_m: null, yaw_rad: null, pinned: null },
          "The object is as the map has it.")),
        this.action("Remove", () => this.remove(thing), "danger")),
    ];
  }

  private ofRoom(room: Room): HTMLElement[] {
    const { data } = this;
    const things = data.things.filter((thing) => thing.room === room.id);
    const seen = data.coverage?.by_room.find(({ room: id }) => id === room.id);
    const facts: [string, Node | string][] = [
      ["Area", area(room.area_m2)],
      ["Objects", things.length > 0 ? counted(things.map(thingName)) : "none"],
      ["From", room.source === "lidar_map" ? "the robot's map" : "the walls of the map"],
    ];
    if (seen) facts.push(["Filmed", `${percent(seen.seen)} of its walls, ${percent(seen.floor_seen)} of its floor`]);
    if (room.corrected.length > 0) facts.push(["Corrected", room.corrected.map(fieldWord).join(", ")]);
    const neighbours = data.rooms.filter((other) => other !== room && areNear(room, other));
    return [
      this.head(roomName(room)), definitions(facts),
      h("div", { class: "row" },
        this.action("Rename", async () => {
          const name = await askText("Name of the room", room.name ?? "", "Rename", MOST_LETTERS);
          if (name !== null) await this.correctRoom(room, { name: name || null }, nameTold(name));
        }),
        neighbours.length > 0 && this.action("Merge", async () => {
          const other = await ask("Merge rooms", `${named(roomName(room))} and this room become one:`,
            [...neighbours.map((near) => ({ word: roomName(near), value: near.id })), { word: "Cancel", value: null }]);
          if (other) await this.correctRoom(room, { merge_with: [other] }, "The rooms are one.");
        }),
        this.action("Split", () => this.split(room)),
        room.corrected.length > 0 && this.action("Withdraw corrections", () =>
          this.correctRoom(room, { name: null, merge_with: null, split_by: null }, "The room is as the map has it."))),
    ];
  }

  /** The service corrects rooms of the clips' map only. */
  private ofRobotRoom(room: RobotRoom): HTMLElement[] {
    return [
      this.head(roomName(room)), definitions([["Area", area(room.area_m2)], ["From", "the robot's map"]]),
      h("p", { class: "hint" }, "Its outline and its objects appear when a clip has its place."),
    ];
  }

  private async split(room: Room): Promise<void> {
    this.divided = room.id;
    const line = await this.measure.line("Tap or click two points: the line through them divides the room.");
    if (roomOf(this.data, this.looks.selected)?.id === room.id) {
      this.element.querySelector<HTMLElement>("[data-key=Split]")?.focus({ preventScroll: true });
    }
    if (!line) return;
    const [from, to] = line.map(([x, y]): [number, number] => [x, y]);
    if (from && to) await this.correctRoom(room, { split_by: { from_m: from, to_m: to } }, "The room is divided.");
  }

  private linkTo(room: Room): HTMLElement {
    const button = h("button", { type: "button", class: "link", "data-key": room.id, dir: "auto" }, roomName(room));
    button.addEventListener("click", () => this.looks.select({ kind: "room", id: room.id }));
    return button;
  }

  /** A button of the card. Buttons that replace each other have the same key. */
  private action(word: string, act: () => Promise<void>, kind = "", key = word): HTMLElement | null {
    if (!mayChange()) return null;
    const button = h("button", { type: "button", class: `small ${kind}`, "data-key": key, title: MEANINGS[word] }, word);
    button.addEventListener("click", () => void attempt(button, act));
    return button;
  }

  private async correctThing(thing: Thing, patch: ThingPatch, done: string): Promise<void> {
    await api.correctThing(this.data.home.id, thing.id, patch);
    this.corrected(done);
  }

  private async correctRoom(room: Room, patch: RoomPatch, done: string): Promise<void> {
    await api.correctRoom(this.data.home.id, room.id, patch);
    this.corrected(done);
  }

  private corrected(done: string): void {
    say(`${done} The map is being rebuilt.`);
    this.onCorrected();
  }

  private async remove(thing: Thing): Promise<void> {
    await api.correctThing(this.data.home.id, thing.id, { hidden: true });
    this.data.remove(thing);
    this.close(true);
    offer(`${named(thingName(thing))} is removed from the map.`, "Undo", () => attempt(null, async () => {
      await api.correctThing(this.data.home.id, thing.id, { hidden: null });
      this.data.bringBack(thing.id, thing);
      this.onCorrected();
    }));
    this.onCorrected();
  }

  private askClass(now: string): Promise<string | null> {
    const known = this.data.classes.map(({ name }) => name).filter((name) => !NO_OBJECT.has(name));
    const options = known.sort((a, b) => plain(a).localeCompare(plain(b))).map((name) =>
      h("option", { value: name, selected: name === now }, plain(name)));
    const select = h("select", { "aria-label": "Class", autofocus: true }, ...options);
    return ask("Change class", select, [
      { word: "Cancel", value: null },
      { word: "Change", value: () => select.value, kind: "primary" },
    ]).then((chosen) => (chosen ? chosen() : null));
  }
}

/** The meanings of buttons whose words do not tell it. */
const MEANINGS: Record<string, string> = {
  Pin: "Keep it as it is, whatever later clips show",
  Unpin: "Let later clips change it again",
  Merge: "Make one room of this one and a neighbour",
  Split: "Divide the room by a line",
  "Withdraw corrections": "Show it again as the service found it",
};

/** The fields of corrections in the words of the page. */
const FIELD_WORDS: Record<string, string> = {
  centre_m: "place", size_m: "size", yaw_rad: "direction", pinned: "pinned", hidden: "removed", merge_with: "merged", split_by: "divided",
};

/** The message after a name was entered; an empty one gives the service's own back. */
function nameTold(name: string): string {
  return name ? "The name is kept." : "It has its own name again.";
}

function fieldWord(field: string): string {
  return FIELD_WORDS[field] ?? plain(field).toLowerCase();
}

/** Classes of surfaces and of what moves by itself. */
const NO_OBJECT = new Set(["floor", "wall", "ceiling", "person", "animal", "other"]);

function definitions(facts: [string, Node | string][]): HTMLElement {
  return h("dl", { class: "facts small" }, ...facts.flatMap(([name, value]) => [h("dt", {}, name), h("dd", {}, value)]));
}

/** `Chair × 2, Table` of a list of names. */
function counted(names: string[]): string {
  const counts = new Map<string, number>();
  for (const name of names) counts.set(name, (counts.get(name) ?? 0) + 1);
  return [...counts].map(([name, count]) => (count > 1 ? `${name} × ${count}` : name)).join(", ");
}

function areNear(a: Room, b: Room): boolean {
  const reach = NEIGHBOURS_M * NEIGHBOURS_M;
  return edges(a).some(([p, q]) => b.polygon_m.some((r) => squared(r, p, q) < reach)) ||
    edges(b).some(([p, q]) => a.polygon_m.some((r) => squared(r, p, q) < reach));
}

type Point = readonly [number, number];

function edges({ polygon_m }: Room): (readonly [Point, Point])[] {
  return polygon_m.map((point, i) => [point, polygon_m[(i + 1) % polygon_m.length] ?? point]);
}

/** Squared distance of a point from a line between two others. */
function squared([x, y]: Point, [x1, y1]: Point, [x2, y2]: Point): number {
  const [dx, dy] = [x2 - x1, y2 - y1];
  const along = Math.min(1, Math.max(0, ((x - x1) * dx + (y - y1) * dy) / (dx * dx + dy * dy || 1)));
  return (x - x1 - along * dx) ** 2 + (y - y1 - along * dy) ** 2;
}
