// Errors and messages, shown once and announced to screen readers.

import { h } from "../dom.ts";

const SHOWN_MS = 6000;

const said = h("div", { class: "said", role: "status", "aria-live": "polite" });
const alarms = h("div", { class: "alarms", role: "alert" });

export function noticeBoard(): HTMLElement {
  return h("div", { class: "notices" }, said, alarms);
}

/** Something happened; it goes away by itself. It may offer to take it back. */
export function say(text: string, offer?: { word: string; act: () => unknown }): void {
  const button = offer && h("button", { type: "button", class: "small" }, offer.word);
  const note = h("p", { class: "toast" }, h("span", {}, text), button);
  button?.addEventListener("click", () => {
    note.remove();
    offer?.act();
  });
  said.append(note);
  setTimeout(() => note.remove(), offer ? 2 * SHOWN_MS : SHOWN_MS);
}

/** Something failed; it stays until it is closed. A failure that repeats is shown once. */
export function alarm(text: string): void {
  if ([...alarms.children].some((note) => note.firstChild?.textContent === text)) return;
  const close = h("button", { type: "button", class: "quiet icon", "aria-label": "Dismiss" }, "✕");
  const note = h("p", { class: "toast bad" }, h("span", {}, text), close);
  close.addEventListener("click", () => note.remove());
  alarms.append(note);
}

export function clearNotices(): void {
  alarms.replaceChildren();
}

export function messageOf(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}

/** Runs the action of a button, which rests meanwhile, and tells a failure. A disabled button would lose the focus. */
export async function attempt(button: HTMLButtonElement | null, act: () => Promise<void>): Promise<void> {
  if (button?.getAttribute("aria-disabled") === "true") return;
  button?.setAttribute("aria-disabled", "true");
  try {
    await act();
  } catch (error) {
    alarm(messageOf(error));
  } finally {
    button?.removeAttribute("aria-disabled");
  }
}
