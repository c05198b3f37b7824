// The shapes of a plan.

import { css, type Rgb } from "../cloud/colours.ts";
import { s } from "../dom.ts";
import { corners, place, type Point2 } from "../frames.ts";
import type { Pose2, Room, Thing } from "../types.ts";
import { at } from "./view.ts";

/** A dot for each of many points, as one path. */
export function dots(points: Point2[], name: string): SVGElement {
  const path = points.map((point) => `M${at(point)}h0`).join("");
  return s("path", { class: `dots ${name}`, d: path });
}

export function line(points: Point2[], colour: Rgb | null, name = "way"): SVGElement {
  const attributes = { class: name, points: points.map(at).join(" ") };
  const shape = s("polyline", attributes);
  if (colour) shape.style.stroke = css(colour);
  return shape;
}

/** A camera on the floor: a wedge that opens where it looks. */
export function wedge(pose: Pose2, colour: Rgb | null, title?: string): SVGElement {
  const tips: Point2[] = [[0, 0], [0.45, 0.26], [0.45, -0.26]];
  const shape = s("polygon", { class: "wedge", points: tips.map((tip) => at(place(pose, tip))).join(" ") });
  if (colour) {
    shape.style.stroke = css(colour);
    shape.style.fill = css(colour);
  }
  if (title) shape.append(s("title", {}, title));
  return shape;
}

/** A line that is measured, with a dot at each end. */
export function rule(ends: Point2[]): SVGElement {
  const group = s("g", { class: "rule" }, s("path", { class: "dots", d: ends.map((end) => `M${at(end)}h0`).join("") }));
  if (ends.length > 1) group.append(line(ends, null, "rule-line"));
  return group;
}

export function room(room: Room, name = "room", colour: Rgb | null = null): SVGElement {
  const rings = [room.polygon_m, ...(room.holes_m ?? [])].filter((ring) => ring.length > 2);
  const path = rings.map((ring) => `M${ring.map(at).join("L")}Z`).join("");
  const shape = s("path", { class: name, d: path, "fill-rule": "evenodd" });
  if (colour) shape.style.fill = css(colour);
  return shape;
}

export function thing(thing: Thing, colour: Rgb, title: string): SVGElement {
  const outline = corners(thing.centre_m, thing.size_m, thing.yaw_rad);
  const shape = s("polygon", { class: "thing", points: outline.map(at).join(" ") });
  shape.style.stroke = css(colour);
  shape.style.fill = css(colour);
  shape.append(s("title", {}, title));
  return shape;
}
