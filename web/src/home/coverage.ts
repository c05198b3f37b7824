// Tells how much of each room the clips show, and which room is worth filming next.

import { css, type Rgb } from "../cloud/colours.ts";
import { h, isByKey, put, putAgain } from "../dom.ts";
import { ramped } from "../plan/raster.ts";
import type { Room } from "../types.ts";
import { named, percent } from "../words.ts";
import type { HomeData } from "./data.ts";
import { roomName, type Selection } from "./selection.ts";

/** A room with less of its walls in the map is worth filming. */
const FILMED = 0.5;
export const WANTED: Rgb = [217, 130, 0];

export interface Filmed {
  room: Room;
  /** The shares of its walls and of its floor that the clips show. */
  walls: number;
  floor: number;
}

/** The rooms whose coverage is known, in the order of the length of their walls that no clip shows. */
export function filmedRooms({ rooms, coverage }: Pick<HomeData, "rooms" | "coverage">): Filmed[] {
  const known = (coverage?.by_room ?? []).flatMap(({ room: id, seen, floor_seen }): Filmed[] => {
    const room = rooms.find((one) => one.id === id);
    return room ? [{ room, walls: seen, floor: floor_seen }] : [];
  });
  const missing_m = ({ room, walls }: Filmed) => (1 - walls) * perimeter_m(room);
  return known.sort((a, b) => missing_m(b) - missing_m(a));
}

function perimeter_m({ polygon_m }: Room): number {
  return polygon_m.reduce((sum, [x, y], i) => {
    const [u, v] = polygon_m[(i + 1) % polygon_m.length] ?? [x, y];
    return sum + Math.hypot(u - x, v - y);
  }, 0);
}

/** The rooms that are worth filming, the next one first. */
export function wantedRooms(data: Pick<HomeData, "rooms" | "coverage">): Room[] {
  return filmedRooms(data).filter(({ walls }) => walls < FILMED).map(({ room }) => room);
}

export class CoveragePanel {
  readonly element = h("div", {});
  private drawn = "";

  constructor(
    private readonly data: HomeData,
    private readonly onChosen: (selection: Selection, isByKey: boolean) => void,
  ) {
    this.draw();
  }

  draw(): void {
    const rooms = filmedRooms(this.data);
    const [next] = wantedRooms(this.data);
    const drawn = JSON.stringify([this.data.map !== null, ...rooms.map(({ room, ...shares }) => [room.id, roomName(room), shares])]);
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    if (rooms.length === 0) return put(this.element, h("p", { class: "hint" }, this.data.map
      ? "This level has no rooms whose coverage is known." : "Coverage appears with the first map."));
    putAgain(this.element,
      h("p", { class: "hint" }, next
        ? `Film ${named(roomName(next))} next: the clips show ${percent(rooms.find(({ room }) => room === next)?.walls)} of its walls.`
        : "The clips show at least half of the walls of every room."),
      h("ul", { class: "things" }, ...rooms.map((filmed) => this.row(filmed, filmed.room === next))));
  }

  private row({ room, walls, floor }: Filmed, isNext: boolean): HTMLElement {
    const bar = h("span", { class: "coverage-bar" });
    bar.style.setProperty("--share", percentOf(walls));
    bar.style.setProperty("--paint", css(ramped(walls)));
    const button = h("button", { type: "button", class: "coverage-row", "data-key": `coverage ${room.id}`, title: `${percent(floor)} of its floor` },
      h("span", { class: "word" }, h("bdi", {}, roomName(room)), isNext ? h("strong", { class: "next" }, " · film here next") : null),
      bar, h("span", { class: "hint figure" }, percent(walls)), h("span", { class: "hidden-text" }, `of its walls, ${percent(floor)} of its floor`));
    button.addEventListener("click", (event) => this.onChosen({ kind: "room", id: room.id }, isByKey(event)));
    return h("li", {}, button);
  }
}

function percentOf(share: number): string {
  return `${Math.round(100 * Math.min(1, Math.max(0, share)))}%`;
}
