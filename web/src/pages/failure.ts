// The page that tells why another one cannot be shown, and the next step. After a failure that passes, it tries again by itself.

import { Refusal } from "../api.ts";
import { h, put } from "../dom.ts";
import { Backoff, whenDue } from "../parts/backoff.ts";
import { messageOf } from "../parts/notices.ts";
import { toHomes } from "../route.ts";
import { type Place, setCrumbs } from "./page.ts";

/** Titles and advice for pages that cannot be shown, by the status of the answer. */
const FAILURES: Record<string, [title: string, advice: string]> = {
  0: ["This cannot be shown", "Check the network of this device. If other pages open, tell the person who runs the service."],
  403: ["This key may not see this", "Sign out to enter another key, or ask the operator of the service for one."],
  404: ["This is not here", "Check the address, or look for the home in the list."],
};
const BY_ITSELF = "This page tries again by itself.";

export class FailurePage {
  private readonly backoff = new Backoff();
  /** The shown failure; empty while another page is shown. */
  private shown = "";

  /** `again` shows the page of the address; `isQuiet` if nobody asked for it, so that a repeated failure changes nothing. */
  constructor(private readonly again: (isQuiet: boolean) => void) {}

  /** Forgets the failures before: a person asked for a page. */
  reset(): void {
    this.backoff.reset();
    this.shown = "";
  }

  show(place: Place, error: unknown): void {
    const status = error instanceof Refusal ? error.status : null;
    const wait_ms = this.backoff.next_ms(error);
    if (wait_ms !== null) whenDue(wait_ms, () => this.again(true), place.signal);
    const [title, advice] = FAILURES[String(status)] ?? ["This cannot be shown", ""];
    const shown = JSON.stringify([title, messageOf(error), wait_ms !== null]);
    // A button that is drawn again would lose the focus.
    if (shown === this.shown) return;
    this.shown = shown;
    if (status === 404) setCrumbs(place, [{ word: "Homes", href: toHomes() }], "Not here");
    put(place.main, h("section", { class: "empty" },
      h("h1", {}, title), h("p", {}, messageOf(error)), advice && h("p", {}, advice), wait_ms !== null && h("p", {}, BY_ITSELF),
      h("p", { class: "row" },
        h("button", { type: "button", class: "primary", onclick: () => this.again(false) }, "Try again"),
        h("a", { class: "button", href: toHomes() }, "All homes"))));
  }
}
