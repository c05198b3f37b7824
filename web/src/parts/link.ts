// Shares the link to a view: copies it, or shows it where the browser does not let a page copy.

import { h } from "../dom.ts";
import { ask } from "./dialog.ts";
import { say } from "./notices.ts";

/** Told with every link: it gives no right to see the home. */
const FOR_WHOM = "It opens for people who can sign in to this service.";

export async function shareLink(address: string): Promise<void> {
  try {
    // Browsers have a clipboard for secure pages only.
    await navigator.clipboard.writeText(address);
    say(`The link to this view is copied. ${FOR_WHOM}`);
  } catch {
    const field = h("input", { type: "text", readonly: true, value: address, "aria-label": "Link to this view", autofocus: true });
    field.addEventListener("focus", () => field.select());
    await ask("Copy this link", h("label", { class: "field" }, `${FOR_WHOM} This browser does not let the page copy it, so copy it yourself:`, field),
      [{ word: "Done", value: null, kind: "primary" }]);
  }
}
