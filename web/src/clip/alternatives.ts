// The places that explain a clip, side by side on the plan, with a button to choose.

import { clipColour } from "../cloud/colours.ts";
import { h } from "../dom.ts";
import { around, place, type Point2 } from "../frames.ts";
import { dots, line, wedge } from "../plan/shapes.ts";
import { PlanView } from "../plan/view.ts";
import type { Alternative, Clip, LidarMap, Scan } from "../types.ts";
import { decimal, degrees, levelWord, many, metres, percent } from "../words.ts";
import { isLast, isOfEarlierMap } from "./last.ts";
import { hasWrongFiles, isDoubtful, isForeign, mayBeForeign, noneIsRight } from "./plausible.ts";
import { chosenOf, poseInForce } from "./pose.ts";

/** Places less probable than this are folded away. */
const UNLIKELY = 0.01;

/** The data that a plan with a pose is drawn from. */
export interface Ground {
  /** Of all levels. */
  lidars: LidarMap[];
  /** By level, the LiDAR map's picture without its paper. */
  pictures: Map<string, string>;
  scan: Scan | null;
}

/**
 * The plan of a level with a clip at a pose: its hits, its way and where it began. The frame of an earlier LiDAR map is not
 * that of the current one, so poses in it are drawn without the map.
 */
function planAt(ground: Ground, isEarlier: boolean, { level, map_from_clip: at }: Alternative, label: string): PlanView {
  const plan = new PlanView(label, null);
  const { lidars, pictures, scan } = ground;
  const lidar = isEarlier ? null : (lidars.find((map) => map.level === level) ?? null);
  const hits = (scan?.hits_m ?? []).map((hit) => place(at, hit));
  const way = (scan?.cameras ?? []).map(({ position_m: [x, y] }): Point2 => place(at, [x, y]));
  plan.setPicture(pictures.get(level) ?? null, lidar?.image ?? null);
  plan.setLayer("hits", dots(hits, "hit"));
  plan.setLayer("paths", line(way, clipColour(0)), wedge(at, clipColour(0), "The first camera"));
  const ends = lidar ? [lidar.info.min_m, lidar.info.max_m] : hits;
  const bounds = around([...ends, [at.x_m, at.y_m]]);
  if (bounds) plan.setBounds(bounds);
  return plan;
}

/** The heading of the places: the answer, if there is one. */
export function headingOf(clip: Clip): string {
  const places = clip.alignment?.alternatives ?? [];
  const count = places.filter(({ probability }) => (probability ?? 1) >= UNLIKELY).length;
  const chosen = chosenOf(clip);
  if (isLast(clip)) return chosen === null ? "Places of the last answer" : "Its last place";
  if (clip.state === "failed" || isForeign(clip) || (chosen === null && hasWrongFiles(clip))) return "Places that were tried";
  if (chosen !== null) return clip.choice ? `Its place: place ${chosen + 1}, chosen by a person` : "Its place";
  if (poseInForce(clip)) return "Places of the newest answer; the clip lies elsewhere";
  if (mayBeForeign(clip)) return "Places that were tried; none stands out";
  return places.length === 1 ? "The place that was found" : `${many(count, "place")} that may be right`;
}

/** One figure for each alternative, those that are not the answer folded away. `onChoose` is null where nothing can be chosen. */
export function alternatives(
  clip: Clip,
  ground: Ground,
  onChoose: ((index: number, button: HTMLButtonElement) => void) | null,
): HTMLElement {
  const list = clip.alignment?.alternatives ?? [];
  const chosen = chosenOf(clip);
  const isEarlier = isOfEarlierMap(clip);
  const isOffered = chosen === null && !isForeign(clip) && clip.state !== "failed";
  // Without walls, places that are not the first one tell nothing. A failed answer has no probabilities.
  const areCompared = chosen !== null || isEarlier || clip.state === "failed";
  const [likely, others]: [HTMLElement[], HTMLElement[]] = [[], []];
  list.forEach((one, i) => {
    const isLikely = areCompared ? i === (chosen ?? 0) : i < 2 || (one.probability ?? 1) >= UNLIKELY;
    const isPrimary = isOffered && i === 0 && !isDoubtful(clip, one);
    (isLikely ? likely : others).push(card(one, i, { isChosen: i === chosen, isPrimary }, clip, ground, onChoose));
  });
  const rest = h("details", { class: "less-likely" },
    h("summary", {}, areCompared
      ? `${many(others.length, "other place")} that ${others.length === 1 ? "was" : "were"} compared`
      : `${many(others.length, "place")} of less than 1 %`),
    h("ol", { class: "alternatives" }, ...others));
  const why = isEarlier && h("p", { class: "hint" },
    "Drawn without walls: the new LiDAR map may lie elsewhere. The pictures show the previous one.");
  const none = areCompared ? null : noneIsRight(clip);
  const missing = none !== null && none >= UNLIKELY && h("p", { class: "none-right" }, `None of these places: ${percent(none)}`);
  return h("div", {}, why, h("ol", { class: "alternatives" }, ...likely), others.length > 0 ? rest : null, missing);
}

function card(
  one: Alternative,
  index: number,
  { isChosen, isPrimary }: { isChosen: boolean; isPrimary: boolean },
  clip: Clip,
  ground: Ground,
  onChoose: ((index: number, button: HTMLButtonElement) => void) | null,
): HTMLElement {
  const name = `Place ${index + 1}`;
  const { x_m, y_m, yaw_rad } = one.map_from_clip;
  const plan = planAt(ground, isOfEarlierMap(clip), one, `${name} on the plan`);
  const bar = one.probability === null ? null
    : h("meter", { min: 0, max: 1, value: one.probability, "aria-label": `Probability of ${name}` });
  const button = h("button", { type: "button", class: isPrimary ? "primary" : "", "data-key": name }, `Choose ${name.toLowerCase()}`);
  button.addEventListener("click", () => onChoose?.(index, button));
  // It takes the focus of the button that chose it.
  const here = h("p", { class: "hint", tabindex: -1, "data-key": name }, isLast(clip) ? "The clip lay here." : "The clip lies here.");
  return h("li", { class: isChosen ? "card chosen" : "card", "data-alternative": index },
    h("figure", {}, plan.element,
      h("figcaption", {},
        h("p", { class: "row between" },
          h("strong", {}, name), h("span", { class: "figure" }, percent(one.probability))),
        bar,
        h("dl", { class: "facts small" },
          ...(ground.lidars.length > 1 ? [h("dt", {}, "Level"), h("dd", {}, levelWord(one.level))] : []),
          h("dt", { title: "inliers" }, "Fits the walls"), h("dd", {}, percent(one.inliers))),
        h("details", { class: "technical" }, h("summary", {}, "More figures"),
          h("dl", { class: "facts small" },
            h("dt", {}, "Position"), h("dd", {}, `x ${decimal(x_m, 2)} m, y ${decimal(y_m, 2)} m`),
            h("dt", {}, "Turned by"), h("dd", {}, degrees(yaw_rad)),
            h("dt", { title: "loss_m" }, "Misfit"), h("dd", {}, metres(one.loss_m)),
            ...freeSpace(one), ...misplaced(one))),
        isChosen ? here : onChoose ? button : null)));
}

function freeSpace({ free_space }: Alternative): HTMLElement[] {
  if (!free_space) return [];
  return [
    h("dt", {}, "Rays through walls"), h("dd", {}, percent(free_space.blocked_rays)),
    h("dt", {}, "Hits on free floor"), h("dd", {}, percent(free_space.hits_on_floor)),
    h("dt", {}, "Walls' unseen sides"), h("dd", {}, percent(free_space.unseen_sides)),
  ];
}

function misplaced({ misplaced: share }: Alternative): HTMLElement[] {
  // Answers of older servers do not have it.
  return typeof share === "number" ? [h("dt", {}, "Things in the wrong room"), h("dd", {}, percent(share))] : [];
}
