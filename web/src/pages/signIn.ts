// Asks for a key, if the service serves nobody without one.

import { Refusal, signIn } from "../api.ts";
import { h, put } from "../dom.ts";
import { attempt } from "../parts/notices.ts";
import { isLoopback, readSession } from "../session.ts";
import { type Place, setCrumbs } from "./page.ts";

const NO_COOKIE = "The key is right, but the browser kept no session cookie. Open the service over https.";

/** Shows the form; `then` is called when the browser is signed in. */
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
      await checkCookie(place.signal);
      then();
    });
  });
  const keepsNone = !isSecureContext && !isLoopback(location.hostname);
  put(place.main, h("section", { class: "empty" },
    h("h1", {}, "This service asks for a key"),
    h("p", {}, "The operator of the service makes one with ", h("code", {}, "viola keys create"),
      ". This browser stays signed in for 12 hours, or until you sign out."),
    keepsNone && h("p", { class: "failed reason" },
      "This address has no TLS, so the browser will not keep the session cookie. Open the service over https."),
    form));
  key.focus();
}

/** The cookie is for TLS only, and a browser drops it without a word. */
async function checkCookie(signal: AbortSignal): Promise<void> {
  try {
    await readSession(signal);
  } catch (error) {
    throw error instanceof Refusal && error.status === 401 ? new Refusal(401, NO_COOKIE) : error;
  }
}
