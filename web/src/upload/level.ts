// Asks whether a LiDAR map replaces the one of its level, or is the map of another level.

import { h } from "../dom.ts";
import { ask, type Option } from "../parts/dialog.ts";
import type { Target } from "./map.ts";

const MOST_LEVELS = 8;

/** The level of a map; null if the person cancels. `taken` are the names of the levels that have a map. */
export async function askTarget(file: File, now: Target, taken: string[]): Promise<Target | null> {
  const name = h("input", {
    type: "text", required: true, pattern: "[a-z0-9_\\-]{1,32}", maxlength: 32, autofocus: true, autocomplete: "off",
    spellcheck: "false", title: "1 to 32 of the characters a-z, 0-9, _ and -", placeholder: "upper",
  });
  name.addEventListener("input", () =>
    name.setCustomValidity(taken.includes(name.value) ? "There is a level of this name." : ""));
  const options: Option<() => Target | null>[] = [
    { word: "Replace map", value: () => now, kind: "danger" },
    { word: "Cancel", value: () => null },
  ];
  const canAdd = taken.length < MOST_LEVELS;
  // Enter in a text presses the first button, which must be the harmless one.
  if (canAdd) {
    const added = () => ({ level: name.value, replaces: null });
    options.unshift({ word: "Add level", value: added, kind: "primary", needsFields: true });
  }
  const text = canAdd
    ? h("label", { class: "field" }, `Name of a new level for ${file.name}, if it shows another storey:`, name)
    : `${file.name} would replace it. A home has at most ${MOST_LEVELS} levels.`;
  const chosen = await ask(`The level ${now.level} has a LiDAR map already`, text, options);
  return chosen ? chosen() : null;
}
