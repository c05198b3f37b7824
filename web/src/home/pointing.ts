// Turns a click into the object, the room or the measured point at its place.

import { along, partBelow, type Point3, pointOn, type Ray, thingAbove, thingOn } from "../cloud/pick.ts";
import type { Cloud } from "../cloud/points.ts";
import { OF_SHELL } from "../cloud/surface.ts";
import type { Point2 } from "../frames.ts";
import type { Thing } from "../types.ts";
import type { HomeData } from "./data.ts";
import type { Looks } from "./looks.ts";
import type { Measure } from "./measure.ts";
import { roomAt } from "./selection.ts";

export class Pointing {
  constructor(
    private readonly data: HomeData,
    private readonly looks: Looks,
    private readonly measure: Measure,
    private readonly cloud: () => Cloud | null,
    private readonly things: () => Thing[],
  ) {}

  clickInPlan(point: Point2): void {
    this.click([...point, 0], thingAbove(point, this.things()));
  }

  clickInCloud(ray: Ray, reach_rad: number): void {
    const surface_m = this.surfaceOn(ray, reach_rad);
    const cut_m = this.looks.cut_m ?? Infinity;
    this.click(onRay(ray, surface_m), thingOn(ray, this.things().flatMap((thing) => partBelow(thing, cut_m) ?? []), surface_m));
  }

  /** The point that a click on a ray would measure. */
  pointOn(ray: Ray, reach_rad: number): Point3 | null {
    return onRay(ray, this.surfaceOn(ray, reach_rad));
  }

  /** The distance of the first shown point on a ray; only every `stride`-th point counts. */
  surfaceOn(ray: Ray, reach_rad: number, stride = 1): number | null {
    const { looks, data } = this;
    const cloud = this.cloud();
    if (!cloud || !looks.layers.has("points")) return null;
    const { position, kind, normal } = cloud.raw;
    const idsOf = (isMeant: (name: string) => boolean) =>
      new Set(data.classes.filter(({ name }) => isMeant(name)).map(({ id }) => id));
    const hidden = idsOf((name) => looks.hiddenClasses.has(name));
    const cut_m = looks.cut_m ?? Infinity;
    // The surface of a wall is not drawn from behind.
    const shell = idsOf((name) => looks.isSurface && OF_SHELL.has(name));
    const [dx, dy, dz] = ray.direction;
    const isFromBehind = (i: number) =>
      dx * (normal[4 * i] ?? 0) + dy * (normal[4 * i + 1] ?? 0) + dz * (normal[4 * i + 2] ?? 0) > 0;
    return pointOn(ray, position, cloud.shown, reach_rad, (i) => {
      const id = kind[4 * i] ?? 0;
      return !hidden.has(id) && (position[3 * i + 2] ?? 0) <= cut_m && !(shell.has(id) && isFromBehind(i));
    }, stride);
  }

  private click(point: Point3 | null, thing: Thing | null): void {
    if (this.measure.take(point)) return;
    const room = point && this.looks.layers.has("rooms") ? roomAt(this.data.rooms, [point[0], point[1]]) : null;
    this.looks.select(thing ? { kind: "object", id: thing.id } : room ? { kind: "room", id: room.id } : null);
  }
}

/** The point of a surface that is so far away, else that of the floor. */
function onRay(ray: Ray, surface_m: number | null): Point3 | null {
  const floor_m = ray.direction[2] < 0 ? -ray.origin[2] / ray.direction[2] : null;
  const at_m = surface_m ?? floor_m;
  return at_m === null ? null : along(ray, at_m);
}
