// The object or room that a person looks at.

import { hullOf, type Point3 } from "../cloud/pick.ts";
import { corners, isInside, type Point2 } from "../frames.ts";
import type { RobotRoom, Room, Thing } from "../types.ts";
import { percent, plain } from "../words.ts";
import type { HomeData } from "./data.ts";

/** A picture of a room shows it up to this height. */
const ROOM_HEIGHT_M = 1.5;

export interface Selection {
  kind: "object" | "room";
  id: string;
}

export function isSame(a: Selection | null, b: Selection | null): boolean {
  return a?.kind === b?.kind && a?.id === b?.id;
}

/** The name of an object: that of a person, else its class. */
export function thingName(thing: Thing): string {
  return thing.name ?? plain(thing.class);
}

/** The source of a class that a person set: the service's confidence is that in another class. */
export const SET = "set by a person";

export function isClassSet({ corrected }: Thing): boolean {
  return corrected.includes("class");
}

/** How sure the class of an object is. */
export function sureOf(thing: Thing): string {
  return isClassSet(thing) ? SET : percent(thing.confidence);
}

/** An id without its level: `sofa-1` of `upper~sofa-1`. */
export function withoutLevel(id: string): string {
  return id.replace(/^.*~/, "");
}

export function roomName(room: { name: string | null; id?: string }): string {
  return room.name ?? (room.id ? `Room ${withoutLevel(room.id).replace(/^room-/, "")}` : "Room");
}

export function thingOf(data: HomeData, selected: Selection | null): Thing | null {
  return (selected?.kind === "object" && data.things.find(({ id }) => id === selected.id)) || null;
}

export function roomOf(data: HomeData, selected: Selection | null): Room | null {
  return (selected?.kind === "room" && data.rooms.find(({ id }) => id === selected.id)) || null;
}

export function robotRoomOf(data: HomeData, selected: Selection | null): RobotRoom | null {
  return (selected?.kind === "room" && data.robotRooms.find(({ id }) => id === selected.id)) || null;
}

/** The room around a point of the floor. */
export function roomAt(rooms: readonly Room[], point: Point2): Room | null {
  const isIn = ({ polygon_m, holes_m }: Room) =>
    isInside(polygon_m, point) && !holes_m.some((hole) => isInside(hole, point));
  return rooms.find(isIn) ?? null;
}

/** The corners of what is selected; empty if it is not there. */
export function hullOfSelected(data: HomeData, selected: Selection): Point3[] {
  const thing = thingOf(data, selected);
  if (thing) return hullOf(thing);
  const robotRoom = robotRoomOf(data, selected);
  const ring = robotRoom ? squareOf(robotRoom) : (roomOf(data, selected)?.polygon_m ?? []);
  return ring.flatMap(([x, y]): Point3[] => [[x, y, 0], [x, y, ROOM_HEIGHT_M]]);
}

/** A room of the robot's map has no outline; a square of its area has about its size. */
function squareOf({ centre_m, area_m2 }: RobotRoom): Point2[] {
  const side_m = Math.sqrt(area_m2);
  return corners(centre_m, [side_m, side_m], 0);
}
