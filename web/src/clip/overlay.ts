// The meanings of the colours of `overlay.png`: on a phone the legend inside the picture is too small to read.

import { css, type Rgb } from "../cloud/colours.ts";
import { h } from "../dom.ts";
import type { Clip } from "../types.ts";

/** The inks of the picture; tests/overlay.test.ts compares them with viola-home/src/picture.rs. */
export const INKS = {
  WALL: [52, 58, 64], MATCHED: [22, 163, 74], UNMATCHED: [220, 38, 38], CAMERA: [37, 99, 235], ALTERNATIVE: [234, 88, 12], CHARGER: [147, 51, 234],
} satisfies Record<string, Rgb>;

const MEANINGS: [keyof typeof INKS, string][] = [
  ["WALL", "Wall of the LiDAR map"],
  ["MATCHED", "Seen by the clip, on a wall"],
  ["UNMATCHED", "Seen by the clip, on no wall"],
  ["CAMERA", "Path of the camera"],
  ["ALTERNATIVE", "Another place of the clip"],
  ["CHARGER", "Charger of the robot"],
];

/** The picture has other places only if the clip has some on the level of the first one, and a charger only if the map has one. */
export function overlayLegend({ alignment }: Pick<Clip, "alignment">, hasCharger: boolean): HTMLElement {
  const [best, ...others] = alignment?.alternatives ?? [];
  const isThere = { ALTERNATIVE: others.some(({ level }) => level === best?.level), CHARGER: hasCharger } as Record<string, boolean>;
  const entries = MEANINGS.filter(([ink]) => isThere[ink] ?? true).map(([ink, word]) => {
    // In the dark the inks are turned over with the paper.
    const swatch = h("span", { class: "swatch paper" });
    swatch.style.background = css(INKS[ink]);
    return h("li", { class: "legend-entry" }, swatch, word);
  });
  return h("ul", { class: "picture-legend" }, ...entries);
}
