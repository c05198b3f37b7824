// The context of every page.

import { Refusal } from "../api.ts";
import { type Child, h, put } from "../dom.ts";
import { Backoff } from "../parts/backoff.ts";
import { Repeated } from "../parts/live.ts";
import { messageOf } from "../parts/notices.ts";

export interface Place {
  /** The element of the page. */
  main: HTMLElement;
  crumbs: HTMLElement;
  /** Ends everything the page has begun. */
  signal: AbortSignal;
  /** Shows the page again: the form to sign in, if the session has ended. */
  again: () => void;
}

/** Shows links to the pages above, and this page's name. */
export function setCrumbs(place: Place, above: { word: string; href: string }[], here: string): void {
  const links: Child[] = above.map(({ word, href }) => h("a", { href, dir: "auto" }, word));
  put(place.crumbs, ...links, h("span", { "aria-current": "page", dir: "auto" }, here));
  document.title = `${here} · viola`;
}

interface Reading<T> {
  read: () => Promise<T>;
  /** Shows what was read; returns the milliseconds until the next reading, or null to wait until somebody asks for it. */
  show: (read: T) => number | null;
  /** Tells why the page is not up to date; empty if it is. */
  tell: (failure: string) => void;
}

/** Reads a page when it is asked to, and after each failure until it succeeds. */
export function keepUpToDate<T>({ signal, again }: Place, { read, show, tell }: Reading<T>): Repeated {
  const backoff = new Backoff();
  return new Repeated(async () => {
    try {
      const found = await read();
      if (signal.aborted) return null;
      backoff.reset();
      tell("");
      return show(found);
    } catch (error) {
      if (signal.aborted) return null;
      if (error instanceof Refusal && error.isFinal) return again(), null;
      tell(messageOf(error));
      return backoff.nextReading_ms(error);
    }
  }, signal);
}
