// The context of every page.

import { type Child, h, put } from "../dom.ts";

export interface Place {
  /** Where the page is put. */
  main: HTMLElement;
  crumbs: HTMLElement;
  /** Ends everything the page has begun. */
  signal: AbortSignal;
  /** Shows the page anew: the form to sign in, if the session has ended. */
  again: () => void;
}

/** Where one is: links to the pages above, and this one's name. */
export function setCrumbs(place: Place, above: { word: string; href: string }[], here: string): void {
  const links: Child[] = above.map(({ word, href }) => h("a", { href }, word));
  put(place.crumbs, ...links, h("span", { "aria-current": "page" }, here));
  document.title = `${here} · viola`;
}
