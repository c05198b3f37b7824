// A view of a home as an address: what is shown, from where, and what is selected.

import { COLOURINGS } from "../cloud/colours.ts";
import type { Point3 } from "../cloud/pick.ts";
import type { Viewpoint } from "../cloud/stage.ts";
import { STATES } from "../words.ts";
import { BODIES, LAYERS, MAX_CUT_M, type Looks } from "./looks.ts";

const CENTIMETRES = 2;

/** The view as the query of an address; `level` is null in a home with one. */
export function written(looks: Looks, level: string | null, viewpoint: Viewpoint | null): URLSearchParams {
  const query = new URLSearchParams({
    view: looks.view, as: looks.body, colour: looks.colouring, layers: [...looks.layers].join("."),
  });
  if (level !== null) query.set("level", level);
  if (looks.cut_m !== null) query.set("cut", looks.cut_m.toFixed(CENTIMETRES));
  if (looks.hiddenClasses.size > 0) query.set("without", [...looks.hiddenClasses].join("."));
  if (looks.clips) query.set("clips", looks.clips);
  if (looks.selected) query.set("at", `${looks.selected.kind}.${looks.selected.id}`);
  if (viewpoint) {
    const numbers = [...viewpoint.eye_m, ...viewpoint.target_m].map((value) => value.toFixed(CENTIMETRES));
    query.set("from", numbers.join("_"));
  }
  return query;
}

/** Shows what an address says; whatever it does not say stays. Returns where it looks from. */
export function read(query: URLSearchParams, looks: Looks): Viewpoint | null {
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
  }
  looks.clips = STATES.find((state) => state === query.get("clips")) ?? looks.clips;
  const [, kind, id] = /^(object|room)\.(.+)$/.exec(query.get("at") ?? "") ?? [];
  if ((kind === "object" || kind === "room") && id) looks.selected = { kind, id };
  const numbers = (query.get("from") ?? "").split("_").map(Number);
  if (numbers.length !== 6 || !numbers.every(Number.isFinite)) return null;
  return { eye_m: numbers.slice(0, 3) as Point3, target_m: numbers.slice(3) as Point3 };
}
