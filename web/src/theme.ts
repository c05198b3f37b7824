// Light and dark: the system's wish, or what was chosen here.

import { h } from "./dom.ts";

const KEY = "viola.theme";
const CHOICES = ["system", "light", "dark"] as const;
type Choice = (typeof CHOICES)[number];

const MARKS: Record<Choice, string> = { system: "◐", light: "☀", dark: "☾" };
const changed = new EventTarget();
const system = matchMedia("(prefers-color-scheme: dark)");

function stored(): Choice {
  try {
    const value = localStorage.getItem(KEY);
    return CHOICES.find((choice) => choice === value) ?? "system";
  } catch {
    return "system";
  }
}

let choice: Choice = stored();

export function isDark(): boolean {
  return choice === "dark" || (choice === "system" && system.matches);
}

/** Calls back whenever the page turns light or dark. */
export function onTheme(listen: () => void, signal: AbortSignal): void {
  changed.addEventListener("change", listen, { signal });
}

function apply(): void {
  document.documentElement.dataset.theme = choice;
  changed.dispatchEvent(new Event("change"));
}

/** The button that goes through the choices. */
export function themeButton(): HTMLElement {
  const button = h("button", { type: "button", class: "quiet icon", id: "theme" });
  const describe = () => {
    button.textContent = MARKS[choice];
    button.setAttribute("aria-label", `Theme: ${choice}`);
    button.title = `Theme: ${choice}`;
  };
  button.addEventListener("click", () => {
    choice = CHOICES[(CHOICES.indexOf(choice) + 1) % CHOICES.length] ?? "system";
    try {
      localStorage.setItem(KEY, choice);
    } catch {
      // A browser that keeps nothing still changes the theme until the page is left.
    }
    describe();
    apply();
  });
  describe();
  return button;
}

system.addEventListener("change", apply);
apply();
