// Names that float over the stage where their things are.

import * as THREE from "three";
import { h } from "../dom.ts";
import { arrange, textWidth } from "../parts/labels.ts";
import type { Moment } from "./stage.ts";

export interface Name {
  text: string;
  at_m: [number, number, number];
  /** The lower end of its thing, if that is not the place of the name: a cut below it hides the name. */
  low_m?: number;
  kind: "room" | "object";
}

/** Of a name on the screen; the fonts are those of the style sheet. */
const HEIGHT_PX = 22;
const PADDING_PX = 14;
/** As in the style sheet. */
const MAX_WIDTH_PX = 220;
const FONTS = { room: "650 13px", object: "400 12px" } as const;
/** A room's name is hidden only if this height above its floor is: its own walls do not hide it from above. */
const ROOM_SEEN_AT_M = 2;

export class Names {
  readonly element = h("div", { class: "names", "aria-hidden": "true" });
  /** Names above would lie below the tools. */
  private top = 0;
  private shown: { element: HTMLElement; at: THREE.Vector3; low_m: number; raised_m: number; width: number; isBehind: boolean }[] = [];
  /** Nothing higher is shown. */
  cut_m = Infinity;

  set(names: Name[]): void {
    const toolbar = this.element.closest(".stage")?.querySelector<HTMLElement>(".toolbar");
    this.top = toolbar ? toolbar.offsetTop + toolbar.offsetHeight : 0;
    this.shown = names.map(({ text, at_m, low_m = at_m[2], kind }, i) => ({
      element: this.elementOf(i, text, `name ${kind}`),
      at: new THREE.Vector3(...at_m),
      low_m,
      raised_m: kind === "room" ? ROOM_SEEN_AT_M : 0,
      width: Math.min(textWidth(text, FONTS[kind]) + PADDING_PX, MAX_WIDTH_PX),
      isBehind: false,
    }));
    this.element.replaceChildren(...this.shown.map(({ element }) => element));
  }

  /** The element of the same name stays where it is; a new one is hidden until the next picture places it. */
  private elementOf(index: number, text: string, kind: string): HTMLElement {
    const old = this.shown[index]?.element;
    if (old && old.textContent === text && old.className === kind) return old;
    return h("span", { class: kind, dir: "auto", hidden: true }, text);
  }

  /** Finds the names that are behind something. */
  hide(isBehind: (at: THREE.Vector3) => boolean): void {
    for (const name of this.shown) {
      const at = this.placeOf(name.at);
      name.isBehind = isBehind(at.setZ(at.z + name.raised_m));
    }
  }

  /** The top of a thing that is cut is the cut. */
  private placeOf(at: THREE.Vector3): THREE.Vector3 {
    return at.clone().setZ(Math.min(at.z, this.cut_m));
  }

  /** Puts every name where its thing is now; a name that has no room beside the earlier ones is left out. */
  place({ camera, width, height }: Moment): void {
    const labels = this.shown.map((name) => {
      const seen = this.placeOf(name.at).project(camera);
      const [x, y] = [((seen.x + 1) / 2) * width, ((1 - seen.y) / 2) * height];
      const isOut = !Number.isFinite(x + y) || seen.z > 1 || x < 0 || y < this.top || x > width || y > height;
      // A name at the edge stays whole.
      const inner = Math.min(Math.max(x, name.width / 2), Math.max(width - name.width / 2, 0));
      return isOut || name.isBehind || name.low_m >= this.cut_m ? null : { x: inner, y, width: name.width, height: HEIGHT_PX };
    });
    const shifts = arrange(labels);
    this.shown.forEach(({ element }, i) => {
      const [label, shift] = [labels[i], shifts[i]];
      element.hidden = !label || shift === null || shift === undefined;
      if (!label || element.hidden) return;
      const top = label.y + (shift ?? 0);
      element.style.transform = `translate(${label.x.toFixed(1)}px, ${top.toFixed(1)}px) translate(-50%, -50%)`;
    });
  }
}
