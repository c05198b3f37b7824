// A cloud of points with everything around it, in three dimensions.

import * as THREE from "three";
import type { Thing } from "../types.ts";
import { type Colouring, type Rgb, rgb } from "./colours.ts";
import { cornersOf } from "./fit.ts";
import { NO_CUT_M, PointMaterial } from "./material.ts";
import { type Name, Names } from "./names.ts";
import type { Cloud } from "./points.ts";
import type { Point3, Ray } from "./pick.ts";
import { ruleOf } from "./rule.ts";
import { boxOf, type FloorPicture, floorOf, outlineOf, patchOf, pathOf, release, solidOf } from "./shapes.ts";
import { Stage, type Viewpoint } from "./stage.ts";
import type { ClassLook, Surface } from "./surface.ts";

interface Path {
  places_m: [number, number, number][];
  colour: Rgb;
}

/** Points are drawn at most so much wider where few are drawn. */
const MAX_GROWTH = 3;
/** A name is hidden by points that come so near to the line of sight, if they are so far before it. */
const HIDING_M = 0.06;
const BEHIND_M = 0.4;

export class CloudView {
  readonly element: HTMLElement;
  private readonly stage: Stage;
  private readonly material = new PointMaterial();
  private readonly names = new Names();
  private readonly floor = new THREE.Group();
  private readonly paths = new THREE.Group();
  private readonly boxes = new THREE.Group();
  /** The selected and the measured objects. */
  private readonly selected = new THREE.Group();
  private readonly rule = new THREE.Group();
  private readonly wanted = new THREE.Group();
  private points: THREE.Points | null = null;
  private cloud: { cloud: Cloud; voxel_m: number } | null = null;
  private surface: Surface | null = null;
  /** Boxes end at it; the shaders of the points and of the surface have the same height. */
  private readonly cut = new THREE.Plane(new THREE.Vector3(0, 0, -1), NO_CUT_M);
  private bounds = new THREE.Box3();
  private outline: THREE.Vector3[] = [];
  private isFramed = false;
  /** The distance of the first shown point on a ray; only every `stride`-th point counts. */
  surfaceOn: ((ray: Ray, reach_rad: number, stride: number) => number | null) | null = null;

  constructor(label: string, signal: AbortSignal) {
    this.stage = new Stage(label, signal);
    this.element = this.stage.element;
    this.element.append(this.names.element);
    this.stage.shapes.add(this.floor, this.boxes);
    this.stage.marks.add(this.paths, this.wanted, this.selected, this.rule);
    this.stage.onDrawn = (moment) => this.names.place(moment);
    this.stage.onRest = (eye) => this.names.hide((at) => this.isBehind(eye, at));
    signal.addEventListener("abort", () => {
      for (const group of [this.floor, this.paths, this.boxes, this.selected, this.rule, this.wanted]) release(group);
      this.points?.geometry.dispose();
      this.material.dispose();
    });
  }

  /** True if points hide a place from an eye; every eighth point decides, which is dense enough for a wall. */
  private isBehind(eye: THREE.Vector3, at: THREE.Vector3): boolean {
    if (!this.surfaceOn) return false;
    const way = at.clone().sub(eye);
    const distance_m = way.length();
    const direction = way.divideScalar(distance_m);
    const ray: Ray = { origin: eye.toArray(), direction: direction.toArray() };
    const surface_m = this.surfaceOn(ray, HIDING_M / distance_m, 8);
    return surface_m !== null && surface_m < distance_m - BEHIND_M;
  }

  /** Shows a cloud whose points may still be coming; `voxel_m` is how far apart they are. */
  setCloud(cloud: Cloud, voxel_m: number): void {
    this.clear();
    this.points = new THREE.Points(cloud.geometry, [this.material.material]);
    this.points.frustumCulled = false;
    this.stage.cloud.add(this.points);
    this.cloud = { cloud, voxel_m };
    this.choose();
    this.draw();
  }

  /** Draws the surface in parts if it is shown, else the points. */
  private choose(): void {
    const { cloud: shown, surface } = this;
    if (surface?.group.visible) {
      this.stage.parts = surface;
    } else if (shown) {
      const { cloud, voxel_m } = shown;
      this.stage.parts = {
        hasCoarse: false,
        count: () => (this.points?.visible ? cloud.shown : 0),
        selectCoarse: () => {},
        select: (from, to, focal_px, isRough) => {
          cloud.select(from, to);
          // Slightly more than a voxel, so that surfaces close; fewer points are larger.
          const growth = isRough ? Math.min(MAX_GROWTH, Math.sqrt(1 / (to - from))) : 1;
          this.material.size_px_m = focal_px * voxel_m * 1.25 * growth;
        },
      };
    } else {
      this.stage.parts = null;
    }
  }

  /** Shows no cloud any more. */
  clear(): void {
    if (!this.points) return;
    this.cloud = null;
    this.choose();
    this.stage.cloud.remove(this.points);
    this.points.geometry.dispose();
    this.points = null;
    this.draw();
  }

  /** Shows a surface beside the points, or none; it stays its owner's. */
  setSurface(surface: Surface | null): void {
    if (this.surface === surface) return;
    if (this.surface) this.stage.cloud.remove(this.surface.group);
    this.surface = surface;
    if (surface) this.stage.cloud.add(surface.group);
    this.choose();
    this.draw();
  }

  setSurfaceClasses(looks: readonly ClassLook[]): void {
    this.surface?.setClasses(looks);
    this.draw();
  }

  setColouring(colouring: Colouring): void {
    this.material.colouring = colouring;
    this.surface?.setColouring(colouring);
    this.draw();
  }

  setClass(id: number, colour: string, isShown: boolean): void {
    this.material.classes.set(id, rgb(colour), isShown);
    this.draw();
  }

  setClip(index: number, colour: Rgb, isShown: boolean): void {
    this.material.clips.set(index, colour, isShown);
    this.draw();
  }

  setCut(height_m: number): void {
    this.cut.constant = this.names.cut_m = this.material.cut_m = height_m;
    this.surface?.setCut(height_m);
    this.draw();
  }

  setFloor(picture: FloorPicture | null): void {
    release(this.floor);
    if (picture) this.floor.add(floorOf(picture));
    this.draw();
  }

  setPaths(paths: Path[]): void {
    release(this.paths);
    for (const { places_m, colour } of paths) this.paths.add(pathOf(places_m, colour));
    this.draw();
  }

  setThings(things: Thing[], colourOf: (thing: Thing) => Rgb): void {
    release(this.boxes);
    for (const thing of things) this.boxes.add(boxOf(thing, colourOf(thing), [this.cut]));
    this.draw();
  }

  /** Marks a box, or the outline of a room on the floor; nothing if there is neither. */
  setSelected(thing: Thing | null, ring_m: readonly [number, number][] | null, colour: Rgb): void {
    release(this.selected);
    if (thing) this.selected.add(solidOf(thing, colour), boxOf(thing, colour));
    if (ring_m) this.selected.add(outlineOf(ring_m, colour));
    this.draw();
  }

  /** Outlines rooms that are worth filming, and fills the first. */
  setWanted(rings_m: (readonly [number, number][])[], colour: Rgb): void {
    release(this.wanted);
    for (const ring of rings_m) this.wanted.add(outlineOf(ring, colour));
    const [next] = rings_m;
    if (next) this.wanted.add(patchOf(next, colour));
    this.draw();
  }

  /** Draws the line that is measured, through everything. */
  setRule(ends: Point3[], colour: Rgb): void {
    release(this.rule);
    if (ends.length > 0) this.rule.add(...ruleOf(ends, colour));
    this.draw();
  }

  set onClick(call: (ray: Ray, reach_rad: number) => void) {
    this.stage.onClick = call;
  }

  /** Called after a person moved the view. */
  set onMoved(call: () => void) {
    this.stage.onMoved = call;
  }

  /** The ray through the middle of the picture, and the angle that a few pixels are there. */
  get middle(): [ray: Ray, reach_rad: number] {
    return this.stage.rayAt(0, 0);
  }

  fly(points_m: readonly Point3[]): void {
    this.stage.fly(points_m.map((point) => new THREE.Vector3(...point)));
  }

  get viewpoint(): Viewpoint {
    return this.stage.viewpoint;
  }

  /** Looks from a place that a person chose; nothing else moves the view any more. */
  set viewpoint(viewpoint: Viewpoint) {
    this.isFramed = true;
    this.stage.lookFrom(viewpoint, this.bounds);
  }

  setNames(names: Name[]): void {
    this.names.set(names);
    this.draw();
  }

  show(parts: { points: boolean; surface: boolean; floor: boolean }): void {
    if (this.points) this.points.visible = parts.points;
    if (this.surface) this.surface.group.visible = parts.surface;
    this.choose();
    this.floor.visible = parts.floor;
    this.draw();
  }

  /** Lets the next bounds move the view: what is shown is another place. */
  reframe(): void {
    this.isFramed = false;
  }

  /**
   * Sets the box around the home, and the points that `fit` shows; without points, the corners of the box. They are shown at
   * once until they are firm; then the view stays where one has moved it.
   */
  setBounds(min: Point3, max: Point3, outline_m: readonly Point3[] = [], isFirm = true): void {
    this.bounds = new THREE.Box3(new THREE.Vector3(...min), new THREE.Vector3(...max));
    this.outline = outline_m.length > 0 ? outline_m.map((point) => new THREE.Vector3(...point)) : cornersOf(this.bounds);
    if (!this.isFramed) this.fit();
    this.isFramed ||= isFirm;
  }

  fit(from: "corner" | "above" = "corner"): void {
    this.stage.look({ box: this.bounds, outline: this.outline }, from);
  }

  draw(): void {
    this.stage.draw();
  }
}
