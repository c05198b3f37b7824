// Asks for a key, where the service serves nobody without one.

import { signIn } from "../api.ts";
import { h, put } from "../dom.ts";
import { attempt } from "../parts/notices.ts";
import { type Place, setCrumbs } from "./page.ts";

/** Shows the form; `then` is called when the service took the key. */
export function showSignIn(place: Place, then: () => void): void {
  setCrumbs(place, [], "Sign in");
  const key = h("input", {
    name: "key", type: "password", required: true, placeholder: "viola_…", autocomplete: "current-password",
    spellcheck: "false", maxlength: 128, "aria-label": "Key",
  });
  const button = h("button", { class: "primary" }, "Sign in");
  const form = h("form", { class: "row" }, key, button);
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    void attempt(button, async () => {
      await signIn(key.value.trim());
      then();
    });
  });
  put(place.main, h("section", { class: "empty" },
    h("h1", {}, "This service asks for a key"),
    h("p", {}, "Whoever runs it makes one with ", h("code", {}, "viola keys create"),
      ". This browser stays signed in for 12 hours, or until you sign out."),
    form));
  key.focus();
}
