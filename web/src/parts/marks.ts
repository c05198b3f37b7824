// Small marks that tell states apart by shape as well as by colour.

import { h, s } from "../dom.ts";
import type { Clip, ClipState } from "../types.ts";
import { clipStateMeaning, clipStateWord } from "../words.ts";

function shape(state: ClipState): SVGElement {
  switch (state) {
    case "aligned":
      return s("path", { d: "M3 8.5 6.5 12 13 4.5" });
    case "ambiguous":
      return s("path", { d: "M8 2.5 14 13.5H2ZM8 7v3M8 11.8v.2" });
    case "failed":
      return s("path", { d: "M4 4l8 8M12 4l-8 8" });
    case "aligning":
      return s("path", { class: "turning", d: "M8 2.5a5.5 5.5 0 1 1-5.5 5.5" });
    default:
      return s("circle", { cx: 8, cy: 8, r: 5, "stroke-dasharray": state === "uploaded" ? "2 2.5" : "none" });
  }
}

export function stateMark(state: ClipState): SVGElement {
  return s("svg", { class: `mark ${state}`, viewBox: "0 0 16 16", "aria-hidden": "true" }, shape(state));
}

/** The mark of a clip's state with its word. */
export function stateBadge(clip: Pick<Clip, "state" | "reasons">): HTMLElement {
  const { state } = clip;
  return h("span", { class: `badge ${state}`, title: `${clipStateMeaning(clip)} (${state})` }, stateMark(state), clipStateWord(clip));
}
