// Errors and messages, shown once and announced to screen readers.

import { onAnswer, Refusal } from "../api.ts";
import { h, isByKey } from "../dom.ts";
import { isSessionEnd, reportSessionEnd } from "../session.ts";

const SHOWN_MS = 6000;

const said = h("div", { class: "said", role: "status", "aria-live": "polite" });
const alarms = h("div", { class: "alarms", role: "alert" });
/** The alarms of a lost service, with the time when they were shown. */
const ofLoss = new Map<HTMLElement, number>();
/** The alarms of failed actions. */
const ofActions = new Set<HTMLElement>();
onAnswer(serviceIsBack);

export function noticeBoard(): HTMLElement {
  return h("div", { class: "notices" }, said, alarms);
}

/** Tells that something happened; the message goes away by itself. */
export function say(text: string): void {
  const note = h("p", { class: "toast" }, h("span", {}, text));
  said.append(note);
  setTimeout(() => note.remove(), SHOWN_MS);
}

/** Tells that something happened, and offers to take it back, until the message is closed or the next offer comes. */
export function offer(text: string, word: string, act: () => unknown): void {
  const button = h("button", { type: "button", class: "small" }, word);
  const note = h("p", { class: "toast offer" }, h("span", {}, text), button);
  button.addEventListener("click", (event) => {
    take(note, event);
    act();
  });
  note.append(closeButton(note));
  clearOffers();
  said.append(note);
}

/** Tells that something failed; the message stays until it is closed. A failure that repeats is shown once. */
export function alarm(text: string): HTMLElement {
  const shown = [...alarms.children].find((note) => note.children[0]?.textContent === text);
  if (shown) return shown as HTMLElement;
  const note = h("p", { class: "toast bad" }, h("span", {}, text));
  note.append(closeButton(note));
  alarms.append(note);
  return note;
}

/** Removes the alarms of a lost service, once a person had the time to read them. */
function serviceIsBack(): void {
  for (const [note, since_ms] of ofLoss) {
    const wait_ms = Math.max(0, since_ms + SHOWN_MS - performance.now());
    // The same failure may come again meanwhile.
    setTimeout(() => ofLoss.has(note) || note.remove(), wait_ms);
  }
  ofLoss.clear();
}

/** Removes what an action that succeeds makes untrue. */
function actionSucceeded(): void {
  for (const note of [...ofActions, ...ofLoss.keys()]) note.remove();
  ofActions.clear();
  ofLoss.clear();
}

function closeButton(note: HTMLElement): HTMLElement {
  const close = h("button", { type: "button", class: "quiet icon", "aria-label": "Dismiss" }, "✕");
  close.addEventListener("click", (event) => take(note, event));
  return close;
}

/** Removes a message whose button was pressed. A person with keys goes on in the page, and not at its top. */
function take(note: HTMLElement, click: MouseEvent): void {
  note.remove();
  if (isByKey(click)) document.querySelector("main")?.focus({ preventScroll: true });
}

function clearOffers(): void {
  for (const note of said.querySelectorAll(".offer")) note.remove();
}

/** Clears what belongs to the page that a person leaves. */
export function clearNotices(): void {
  alarms.replaceChildren();
  ofActions.clear();
  ofLoss.clear();
  clearOffers();
}

export function messageOf(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}

/** Tells a failure and returns its alarm, if it has one; `of` names what failed. The end of the session leads to the form to sign in instead. */
export function tellFailure(error: unknown, of = ""): HTMLElement | null {
  const text = of ? `${of}: ${messageOf(error)}` : messageOf(error);
  if (isSessionEnd(error)) {
    reportSessionEnd(text);
    return null;
  }
  const note = alarm(text);
  if (error instanceof Refusal && error.status === 0) ofLoss.set(note, performance.now());
  return note;
}

/** Runs the action of a button, which rests meanwhile, and tells a failure. A disabled button would lose the focus. */
export async function attempt(button: HTMLButtonElement | null, act: () => Promise<void>): Promise<void> {
  if (button?.getAttribute("aria-disabled") === "true") return;
  button?.setAttribute("aria-disabled", "true");
  try {
    await act();
    actionSucceeded();
  } catch (error) {
    const note = tellFailure(error);
    if (note) ofActions.add(note);
  } finally {
    button?.removeAttribute("aria-disabled");
  }
}
