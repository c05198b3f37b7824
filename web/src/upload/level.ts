// Asks whether a LiDAR map replaces the one of its level, or is the map of another level.

import { h } from "../dom.ts";
import { ask, type Option } from "../parts/dialog.ts";
import { idOf, levelWord, named } from "../words.ts";
import type { Target } from "./map.ts";

const MOST_LEVELS = 8;
/** Letters of the id of a level. */
const MOST_LETTERS = 32;

/**
 * The id of a new level of this name: "First floor" becomes `first-floor`, and a name without Latin letters the next
 * free `level-2`. Null if there is no name, or if a level has this id.
 */
export function levelIdOf(name: string, taken: readonly string[]): string | null {
  if (!name.trim()) return null;
  let number = taken.length + 1;
  while (taken.includes(`level-${number}`)) number++;
  const id = idOf(name, MOST_LETTERS, `level-${number}`);
  return taken.includes(id) ? null : id;
}

/** The level of a map; null if the person cancels. `taken` are the ids of the levels that have a map. */
export async function askTarget(file: File, now: Target, taken: string[]): Promise<Target | null> {
  const name = h("input", {
    type: "text", required: true, maxlength: 100, autofocus: true, autocomplete: "off", placeholder: "First floor", dir: "auto",
  });
  const shown = h("span", { class: "hint", role: "status" });
  name.addEventListener("input", () => {
    const id = levelIdOf(name.value, taken);
    name.setCustomValidity(id || !name.value.trim() ? "" : "There is a level of this name.");
    // The service keeps the id only, so the page shows the name that the id gives.
    shown.textContent = id ? `It will be shown as “${levelWord(id)}”.` : "";
  });
  const added = () => {
    const level = levelIdOf(name.value, taken);
    return level === null ? null : { level, replaces: null };
  };
  const canAdd = taken.length < MOST_LEVELS;
  const replace: Option<() => Target | null> = { word: "Replace map", value: () => now, kind: "danger" };
  const cancel = { word: "Cancel", value: () => null };
  // Enter presses the first button, which must be a harmless one.
  const options: (typeof replace)[] = canAdd
    ? [{ word: "Add level", value: added, kind: "primary", needsFields: true }, replace, cancel]
    : [cancel, replace];
  const text = canAdd
    ? h("label", { class: "field" }, `Name of a new level for ${named(file.name)}, if it shows another storey:`, name, shown)
    : `${named(file.name)} would replace it. A home has at most ${MOST_LEVELS} levels.`;
  const chosen = await ask(`The level “${levelWord(now.level)}” has a LiDAR map already`, text, options);
  return chosen ? chosen() : null;
}
