// A view of a home as an address: what is shown, from where, and what is selected.

import { COLOURINGS } from "../cloud/colours.ts";
import type { Point3 } from "../cloud/pick.ts";
import type { Viewpoint } from "../cloud/stage.ts";
import type { Box2, Point2 } from "../frames.ts";
import { levelWord, STATES } from "../words.ts";
import type { HomeData } from "./data.ts";
import { BODIES, LAYERS, MAX_CUT_M, type Looks } from "./looks.ts";
import { hullOfSelected } from "./selection.ts";

const CENTIMETRES = 2;

/** What is in the picture. Null for all of the home, and for the view that is not shown. */
export interface Framing {
  /** In three dimensions. */
  from: Viewpoint | null;
  /** Of the plan, in metres. */
  part: Box2 | null;
}

/** The view as the query of an address; `level` is null in a home with one. */
export function written(looks: Looks, level: string | null, { from, part }: Framing): URLSearchParams {
  const query = new URLSearchParams({
    view: looks.view, as: looks.body, colour: looks.colouring, layers: [...looks.layers].join("."),
  });
  if (level !== null) query.set("level", level);
  if (looks.cut_m !== null) query.set("cut", looks.cut_m.toFixed(CENTIMETRES));
  if (looks.hiddenClasses.size > 0) query.set("without", [...looks.hiddenClasses].join("."));
  if (looks.hiddenClips.size > 0) query.set("without_clips", [...looks.hiddenClips].join("."));
  if (looks.clips) query.set("clips", looks.clips);
  if (looks.hasAllClips) query.set("all_clips", "true");
  if (looks.selected) query.set("at", `${looks.selected.kind}.${looks.selected.id}`);
  const joined = (numbers: number[]) => numbers.map((value) => value.toFixed(CENTIMETRES)).join("_");
  if (from) query.set("from", joined([...from.eye_m, ...from.target_m]));
  if (part) query.set("part", joined([...part.min, ...part.max]));
  return query;
}

/** Sets the looks that an address has; the others stay. */
export function read(query: URLSearchParams, looks: Looks): Framing {
  const [view, colour] = [query.get("view"), query.get("colour")];
  if (view === "2d" || view === "3d") looks.view = view;
  looks.body = BODIES.find((name) => name === query.get("as")) ?? looks.body;
  looks.colouring = COLOURINGS.find((name) => name === colour) ?? looks.colouring;
  const layers = query.get("layers")?.split(".");
  if (layers) {
    looks.layers.clear();
    for (const layer of LAYERS) if (layers.includes(layer)) looks.layers.add(layer);
  }
  const cut_m = Number(query.get("cut") ?? NaN);
  if (Number.isFinite(cut_m) && cut_m > 0) looks.cut_m = cut_m < MAX_CUT_M ? cut_m : null;
  if (layers) {
    looks.hiddenClasses.clear();
    for (const name of query.get("without")?.split(".") ?? []) looks.hiddenClasses.add(name);
    looks.hiddenClips.clear();
    for (const id of query.get("without_clips")?.split(".") ?? []) looks.hiddenClips.add(id);
  }
  looks.clips = STATES.find((state) => state === query.get("clips")) ?? looks.clips;
  looks.hasAllClips ||= query.has("all_clips");
  const [, kind, id] = /^(object|room)\.(.+)$/.exec(query.get("at") ?? "") ?? [];
  if ((kind === "object" || kind === "room") && id) looks.selected = { kind, id };
  const [from, part] = [numbersOf(query.get("from"), 6), numbersOf(query.get("part"), 4)];
  return {
    from: from && { eye_m: from.slice(0, 3) as Point3, target_m: from.slice(3) as Point3 },
    part: part && { min: part.slice(0, 2) as Point2, max: part.slice(2) as Point2 },
  };
}

/** Deselects what the home does not have, and returns what a person is told about an address; null if all of it is there. */
export function deselectMissing(query: URLSearchParams, data: HomeData, looks: Looks): string | null {
  const { selected } = looks;
  const isThere = selected === null || hullOfSelected(data, selected).length > 0;
  if (!isThere) looks.selected = null;
  const level = query.get("level");
  if (level !== null && level !== data.level) return `The level “${levelWord(level)}” of this link is no longer in this home.`;
  return isThere ? null : `The ${selected.kind} of this link is no longer in the map.`;
}

/** The numbers of a text; null unless there are as many as expected. */
function numbersOf(text: string | null, count: number): number[] | null {
  const numbers = (text ?? "").split("_").map(Number);
  return numbers.length === count && numbers.every(Number.isFinite) ? numbers : null;
}
