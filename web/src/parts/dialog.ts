// Questions that must be answered before anything happens. The browser's own dialogs keep the focus inside, and
// close on Escape.

import { type Child, h } from "../dom.ts";

export interface Option<T> {
  word: string;
  value: T;
  kind?: "primary" | "danger";
  /** True if it needs the fields of the question; the browser checks them first. */
  needsFields?: boolean;
}

/** The chosen value; null when the question was closed. The first option has the focus. */
export function ask<T>(title: string, text: Child, options: Option<T>[]): Promise<T | null> {
  return new Promise((resolve) => {
    const heading = h("h2", { id: "question" }, title);
    const buttons = options.map(({ word, kind, needsFields }, i) => h("button", {
      type: "submit", value: String(i), class: kind ?? "", autofocus: i === 0 && typeof text === "string",
      formnovalidate: !needsFields,
    }, word));
    const form = h("form", { method: "dialog" }, heading, typeof text === "string" ? h("p", {}, text) : h("div", { class: "question" }, text),
      h("div", { class: "row end" }, ...buttons));
    const dialog = h("dialog", { "aria-labelledby": "question" }, form);
    // The page that asked is left: by the browser's Back, for one.
    const leave = () => dialog.close();
    addEventListener("hashchange", leave);
    dialog.addEventListener("close", () => {
      removeEventListener("hashchange", leave);
      dialog.remove();
      const option = dialog.returnValue === "" ? undefined : options[Number(dialog.returnValue)];
      resolve(option ? option.value : null);
    });
    document.body.append(dialog);
    dialog.showModal();
  });
}

/** True while a question is open: keys are for it. */
export function isAsking(): boolean {
  return document.querySelector("dialog[open]") !== null;
}

/** Closes the open question: the page that asked is gone, and its question would lie over the form to sign in. */
export function closeQuestions(): void {
  for (const dialog of document.querySelectorAll<HTMLDialogElement>("dialog[open]")) dialog.close();
}

/** A line of text of at most `most` letters; null when the question was closed. */
export function askText(title: string, before: string, word: string, most: number): Promise<string | null> {
  const input = h("input", { type: "text", "aria-label": title, value: before, maxlength: most, autofocus: true, dir: "auto" });
  // Enter in a text presses the form's first button, so the button that does it comes first.
  return ask<boolean>(title, input, [
    { word, value: true, kind: "primary" },
    { word: "Cancel", value: false },
  ]).then((isDone) => (isDone ? input.value.trim() : null));
}

/** True if a person confirms the action. */
export async function confirm(title: string, text: Child, word: string): Promise<boolean> {
  const answer = await ask(title, text, [
    { word: "Cancel", value: false },
    { word, value: true, kind: "danger" },
  ]);
  return answer === true;
}
