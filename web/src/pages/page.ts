// The context of every page.

import { type Child, h, put } from "../dom.ts";

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
