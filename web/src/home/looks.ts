// The visible parts of a home and their colouring.

import { COLOURINGS, type Colouring, NO_COLOUR } from "../cloud/colours.ts";
import type { ClipState } from "../types.ts";
import { isSame, type Selection } from "./selection.ts";

export const LAYERS = ["points", "lidar", "objects", "rooms", "coverage", "paths"] as const;
type Layer = (typeof LAYERS)[number];

export const LAYER_WORDS: Record<Layer, string> = {
  points: "Map of the clips",
  lidar: "LiDAR map",
  objects: "Objects",
  rooms: "Rooms",
  coverage: "Film here next",
  paths: "Camera paths",
};

/** Higher than any ceiling that a phone films. */
export const MAX_CUT_M = 3;

/** The forms of the fused map in three dimensions. */
export const BODIES = ["points", "surface"] as const;
export type Body = (typeof BODIES)[number];

export class Looks {
  view: "3d" | "2d" = "3d";
  body: Body = "points";
  readonly layers = new Set<Layer>(["points", "lidar", "objects", "rooms"]);
  /** By name. A ceiling would hide everything below it. */
  readonly hiddenClasses = new Set<string>(["ceiling"]);
  /** By id. */
  readonly hiddenClips = new Set<string>();
  /** Nothing higher is shown in three dimensions, and no higher point on the plan; null for no limit. */
  cut_m: number | null = null;
  selected: Selection | null = null;
  /** The list shows only clips of this state; null for all. */
  clips: ClipState | null = null;
  /** True if the list shows also the oldest of many clips. */
  hasAllClips = false;
  private readonly listeners: (() => void)[] = [];
  private readonly ofCut: (() => void)[] = [];
  /** False if no point of the shown level has a colour: it would be black. */
  private hasColour = true;
  private wanted: Colouring = "colour";

  /** True if the surface is requested. */
  get isSurface(): boolean {
    return this.view === "3d" && this.body === "surface" && this.layers.has("points");
  }

  get colouring(): Colouring {
    return this.wanted === "colour" && !this.hasColour ? "class" : this.wanted;
  }

  set colouring(colouring: Colouring) {
    this.wanted = colouring;
  }

  get colourings(): readonly Colouring[] {
    return COLOURINGS.filter((name) => this.reasonAgainst(name) === null);
  }

  /** The reason why the map cannot be coloured so; null if it can. */
  reasonAgainst(colouring: string): string | null {
    if (colouring === "colour" && !this.hasColour) return NO_COLOUR;
    return this.isSurface && ["clip", "probability"].includes(colouring) ? "The surface has no clips and no probabilities" : null;
  }

  /** Notes whether a point has a colour. */
  noteColour(hasColour: boolean): void {
    if (hasColour !== this.hasColour) this.change((looks) => (looks.hasColour = hasColour));
  }

  onChange(listen: () => void): void {
    this.listeners.push(listen);
  }

  /** Calls back after a slider moved the cut: it does so many times a second, so no other listener is called. */
  onCut(listen: () => void): void {
    this.ofCut.push(listen);
  }

  cut(height_m: number | null): void {
    if (height_m === this.cut_m) return;
    this.cut_m = height_m;
    for (const listen of this.ofCut) listen();
  }

  select(selected: Selection | null): void {
    if (!isSame(this.selected, selected)) this.change((looks) => (looks.selected = selected));
  }

  change(act: (looks: this) => void): void {
    act(this);
    if (!this.colourings.includes(this.colouring)) this.colouring = "colour";
    for (const listen of this.listeners) listen();
  }
}

/** Puts a thing into a set or takes it out. */
export function put<T>(set: Set<T>, thing: T, isIn: boolean): void {
  if (isIn) set.add(thing);
  else set.delete(thing);
}
