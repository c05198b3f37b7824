// Controls: one of several, and on or off.

import { h } from "../dom.ts";

/** Radio buttons that look like one bar. */
export function oneOf<T extends string>(
  name: string,
  legend: string,
  words: readonly [T, string][],
  chosen: T,
  onChoose: (value: T) => void,
): HTMLFieldSetElement {
  const options = words.map(([value, word]) => {
    const input = h("input", { type: "radio", name, value, id: `${name}-${value}`, checked: value === chosen });
    input.addEventListener("change", () => onChoose(value));
    return h("label", {}, input, h("span", {}, word));
  });
  return h("fieldset", { class: "segments" }, h("legend", { class: "hidden-text" }, legend), ...options);
}

/** Shows which one of several is chosen, and disables those that have a reason not to be; it becomes their title. */
export function showChoice(bar: HTMLFieldSetElement, chosen: string, reasonAgainst: (value: string) => string | null): void {
  for (const input of bar.querySelectorAll("input")) {
    const reason = reasonAgainst(input.value);
    input.checked = input.value === chosen;
    input.disabled = reason !== null;
    if (input.parentElement) input.parentElement.title = reason ?? "";
  }
}

/** A checkbox with a swatch of colour, where it has one. */
export function onOff(
  word: string,
  isOn: boolean,
  onSwitch: (isOn: boolean) => void,
  more: { colour?: string; note?: string; name?: string } = {},
): HTMLLabelElement {
  const name = more.name ?? word;
  const input = h("input", { type: "checkbox", checked: isOn, "data-name": name, "data-key": `switch ${name}` });
  input.addEventListener("change", () => onSwitch(input.checked));
  const swatch = more.colour ? h("span", { class: "swatch" }) : null;
  if (swatch && more.colour) swatch.style.background = more.colour;
  const note = more.note ? h("span", { class: "hint" }, more.note) : null;
  return h("label", { class: "switch" }, input, swatch, h("span", { class: "word" }, word), note);
}
