// Links to files of the service.

import { home } from "../api.ts";
import { h } from "../dom.ts";
import { attempt } from "./notices.ts";

/**
 * A link that downloads a file of a home. A browser gives no reason for a download that fails, so the page asks for the home beside
 * it: a session that has ended, a deleted home and a lost service are told.
 */
export function fileLink(of: string, href: string, name: string, word: string): HTMLAnchorElement {
  const link = h("a", { href, download: name }, word);
  link.addEventListener("click", () => void attempt(null, async () => void (await home(of, new AbortController().signal))));
  return link;
}
