// Names that float over the stage where their things are.

import * as THREE from "three";
import { h } from "../dom.ts";
import type { Moment } from "./stage.ts";

export interface Name {
  text: string;
  at_m: [number, number, number];
  kind: "room" | "object";
}

/** Of a name on the screen. */
const HEIGHT_PX = 22;

export class Names {
  readonly element = h("div", { class: "names", "aria-hidden": "true" });
  private shown: { element: HTMLElement; at: THREE.Vector3; isBehind: boolean }[] = [];

  set(names: Name[]): void {
    this.shown = names.map(({ text, at_m, kind }) => ({
      element: h("span", { class: `name ${kind}` }, text),
      at: new THREE.Vector3(...at_m),
      isBehind: false,
    }));
    this.element.replaceChildren(...this.shown.map(({ element }) => element));
  }

  /** Finds the names that are behind something. */
  hide(isBehind: (at: THREE.Vector3) => boolean): void {
    for (const name of this.shown) name.isBehind = isBehind(name.at);
  }

  /** Puts every name where its thing is now; names that would cover an earlier one are left out. */
  place({ camera, width, height }: Moment): void {
    const taken: { x: number; y: number; reach: number }[] = [];
    for (const { element, at, isBehind } of this.shown) {
      const seen = at.clone().project(camera);
      const [x, y] = [((seen.x + 1) / 2) * width, ((1 - seen.y) / 2) * height];
      const reach = (element.textContent?.length ?? 0) * 3.6 + 6;
      const isOut = seen.z > 1 || x < 0 || y < 0 || x > width || y > height;
      const isCovered = taken.some((other) =>
        Math.abs(other.y - y) < HEIGHT_PX && Math.abs(other.x - x) < other.reach + reach);
      element.hidden = isOut || isCovered || isBehind;
      if (element.hidden) continue;
      taken.push({ x, y, reach });
      element.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px) translate(-50%, -50%)`;
    }
  }
}
