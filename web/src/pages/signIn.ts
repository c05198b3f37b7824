// Asks for a key, if the service serves nobody without one.

import { signIn } from "../api.ts";
import { h, put } from "../dom.ts";
import { attempt, messageOf } from "../parts/notices.ts";
import { isLoopback, isSessionEnd, readSession, tellTabs } from "../session.ts";
import { type Place, setCrumbs } from "./page.ts";

const NO_COOKIE = "The key is right, but the browser kept no session cookie. Open the service over https.";

const ENDED = "You are signed out: in another tab, because 12 hours have passed, or because the key is no longer valid. " +
  "Sign in again to continue on this page.";

/** Shows the form; `then` is called when the browser is signed in. `hasEnded` says that somebody was signed in here. */
export function showSignIn(place: Place, then: () => void, hasEnded = false): void {
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
      await tryKey(key.value.trim(), place.signal);
      tellTabs();
      then();
    });
  });
  const keepsNone = !isSecureContext && !isLoopback(location.hostname);
  put(place.main, h("section", { class: "empty" },
    h("h1", {}, "This service asks for a key"),
    hasEnded && h("p", { class: "reason warning", role: "status" }, ENDED),
    h("p", {}, "The operator of the service makes one with ", h("code", {}, "viola keys create"),
      ". This browser stays signed in for 12 hours, or until you sign out."),
    keepsNone && h("p", { class: "failed reason" },
      "This address has no TLS, so the browser will not keep the session cookie. Open the service over https."),
    form));
  key.focus();
}

/** Signs in. The cookie is for TLS only, and a browser drops it without a word. */
async function tryKey(key: string, signal: AbortSignal): Promise<void> {
  try {
    await signIn(key);
  } catch (error) {
    // A wrong key is no end of a session.
    throw isSessionEnd(error) ? new Error(messageOf(error)) : error;
  }
  try {
    await readSession(signal);
  } catch (error) {
    throw isSessionEnd(error) ? new Error(NO_COOKIE) : error;
  }
}
