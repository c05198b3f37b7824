// All homes.

import { homePath, homes, makeHome, Refusal } from "../api.ts";
import { h, keepFocus, put } from "../dom.ts";
import { attentionFirst, attentionOf, nextStepOf, withAttention } from "../home/attention.ts";
import { stateMark } from "../parts/marks.ts";
import { attempt } from "../parts/notices.ts";
import { type Asked, toHome, toHomes } from "../route.ts";
import { mayChange } from "../session.ts";
import type { Home, List } from "../types.ts";
import { many, STATES, stateTitle, stateWord, time } from "../words.ts";
import { keepUpToDate, type Place, setCrumbs } from "./page.ts";

/** Pause between two readings of the list; an unchanged one is answered with 304. */
const REST_MS = 3000;

export async function showHomes(place: Place, asked: Asked): Promise<void> {
  setCrumbs(place, [], "Homes");
  const first = await homesOrNone(asked, place.signal);
  if (!first) return put(place.main, oneHome());
  const list = new HomeList(asked);
  list.draw(first);
  put(place.main, h("div", { class: "page" },
    h("div", { class: "head" }, h("h1", {}, "Homes"), mayChange() && newHome(place.signal), list.lost), ...list.elements));
  // Also when a person looks at the list again, and regularly while clips or maps are being worked on.
  const repeated = keepUpToDate(place, {
    read: () => readHomes(asked, place.signal),
    show: (page) => {
      list.draw(page);
      return page.items.some(isUnderWay) ? REST_MS : null;
    },
    tell: (failure) => (list.lost.textContent = failure),
  });
  if (first.items.some(isUnderWay)) repeated.again();
}

function isUnderWay({ clips_by_state: { queued, aligning }, map_state }: Home): boolean {
  return queued + aligning > 0 || map_state === "due";
}

class HomeList {
  /** The reason that the list is not up to date. */
  readonly lost = h("p", { class: "reason", role: "status" });
  private readonly search: HTMLElement;
  private readonly list = h("ul", { class: "homes" });
  private readonly nothing: HTMLElement;
  private readonly more = h("a", { class: "button" }, "More homes");
  private readonly isPart: boolean;
  /** The cards by the homes that they show. */
  private cards = new Map<string, HTMLElement>();

  constructor(private readonly asked: Asked) {
    this.isPart = Boolean(asked.text || asked.attention || asked.after);
    this.search = search(asked);
    this.nothing = nothing(this.isPart);
  }

  get elements(): HTMLElement[] {
    const first = this.asked.after === null ? null : h("a", { class: "button", href: toHomes({ ...this.asked, after: null }) }, "First homes");
    return [this.search, this.list, this.nothing, h("p", { class: "row" }, ...(first ? [first] : []), this.more)];
  }

  draw({ items, next }: List<Home>): void {
    const cards = new Map(items.map((home) => {
      const shown = JSON.stringify(home);
      return [shown, this.cards.get(shown) ?? card(home)];
    }));
    if ([...cards.keys()].join() !== [...this.cards.keys()].join()) {
      keepFocus(this.list, () => this.list.replaceChildren(...cards.values()));
    }
    this.cards = cards;
    const isEmpty = items.length === 0;
    this.search.hidden = isEmpty && !this.isPart;
    this.list.hidden = isEmpty;
    this.nothing.hidden = !isEmpty;
    this.more.hidden = !next;
    this.more.href = toHomes({ ...this.asked, after: next });
  }
}

/** A page of homes. Those that need attention come first, and before the first page also those of later pages. */
async function readHomes(asked: Asked, signal: AbortSignal): Promise<List<Home>> {
  if (asked.attention || asked.after !== null) {
    const page = await homes(asked, signal);
    return { ...page, items: attentionFirst(page.items) };
  }
  const [page, urgent] = await Promise.all([homes(asked, signal), homes({ ...asked, attention: true }, signal)]);
  return withAttention(page, urgent);
}

/** Null for a key of one home, which the service does not name. */
async function homesOrNone(asked: Asked, signal: AbortSignal): Promise<List<Home> | null> {
  try {
    return await readHomes(asked, signal);
  } catch (error) {
    if (error instanceof Refusal && error.status === 403) return null;
    throw error;
  }
}

function oneHome(): HTMLElement {
  const id = h("input", {
    type: "text", required: true, placeholder: "flat-3-elm-street", autocomplete: "off", spellcheck: "false", maxlength: 64,
    "aria-label": "Id of the home",
  });
  const form = h("form", { class: "row" }, id, h("button", { class: "primary" }, "Open"));
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    location.hash = toHome(id.value.trim());
  });
  return h("section", { class: "empty" },
    h("h1", {}, "This key is for one home"),
    h("p", {}, "It opens this home only, and not the list of all homes. Enter the id of the home: the operator of the service knows it."),
    form);
}

function nothing(isPart: boolean): HTMLElement {
  if (isPart) {
    return h("section", { class: "empty" },
      h("h2", {}, "No home like this"), h("p", {}, "A home is found by a part of its name or of its id."),
      h("a", { class: "button", href: toHomes() }, "All homes"));
  }
  return h("section", { class: "empty" },
    h("h2", {}, "No home yet"),
    h("p", {}, "A home holds the LiDAR map of its robot vacuum and the clips filmed in it."),
    mayChange()
      ? h("p", {}, "Give it a name above and press “New home”. To look around first, ", h("code", {}, "viola demo"),
          " fills a server with a simulated home.")
      : h("p", {}, "Your key can only look. Homes appear here when an admin makes them."));
}

function search(asked: Asked): HTMLElement {
  const text = h("input", {
    type: "search", value: asked.text, placeholder: "Search homes", "aria-label": "Search homes", maxlength: 200, dir: "auto",
  });
  const attention = h("input", { type: "checkbox", checked: asked.attention });
  const show = () => {
    location.hash = toHomes({ text: text.value.trim(), attention: attention.checked, after: null });
  };
  attention.addEventListener("change", show);
  const form = h("form", { class: "search-homes row", role: "search" }, text,
    h("label", { class: "row" }, attention, "Only homes that need attention"));
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    show();
  });
  return form;
}

function card(home: Home): HTMLElement {
  // A key that can only look cannot take it.
  const step = mayChange() ? nextStepOf(home) : null;
  const picture = home.lidar_map_revision
    ? h("img", {
        class: "paper", alt: "", loading: "lazy", decoding: "async",
        // Another map has another picture.
        src: homePath(home.id, "lidar-map", `image.png?revision=${home.lidar_map_revision}`),
      })
    : h("span", { class: "hint" }, "No LiDAR map yet");
  picture.addEventListener("error", () => picture.replaceWith(h("span", { class: "hint" }, "No picture")));
  return h("li", {},
    h("a", { class: "card home-card", href: toHome(home.id), "data-key": home.id },
      h("span", { class: "thumbnail" }, picture),
      h("span", { class: "card-text" },
        h("strong", { dir: "auto" }, home.name || home.id),
        home.name ? h("code", { class: "hint" }, home.id) : null,
        h("span", { class: "hint" }, `${many(home.clips, "clip")} · changed ${time(home.updated_at)}`),
        states(home), step && h("span", { class: "advice" }, step), ...attention(home))));
}

function attention(home: Home): HTMLElement[] {
  const reasons = attentionOf(home);
  return reasons.length > 0 ? [h("span", { class: "attention" }, ...reasons.map((reason) => h("span", {}, reason)))] : [];
}

/** The number of clips in each state that has any, and whether the map needs attention. */
export function states(home: Pick<Home, "clips_by_state" | "map_state">): HTMLElement {
  const counts = STATES.filter((state) => home.clips_by_state[state] > 0);
  const badges = counts.map((state) => {
    const count = home.clips_by_state[state];
    return h("span", { class: `badge ${state}`, title: stateTitle(state) }, stateMark(state), `${count} ${stateWord(state).toLowerCase()}`);
  });
  const map = home.map_state === "failing" && h("span", { class: "badge failed" }, stateMark("failed"), "map needs attention");
  return h("span", { class: "row states" }, ...badges, map);
}

function newHome(signal: AbortSignal): HTMLElement {
  const name = h("input", {
    name: "name", required: true, placeholder: "Flat 3, Elm Street", autocomplete: "off", maxlength: 200, dir: "auto",
    "aria-label": "Name of the new home",
  });
  const button = h("button", { class: "primary" }, "New home");
  const form = h("form", { class: "new-home" }, name, button);
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    // The browser takes spaces for a name, and the service does not.
    name.value = name.value.trim();
    if (name.value === "") return void name.reportValidity();
    void attempt(button, async () => {
      const id = await makeHome(name.value);
      // The person may have gone to another page meanwhile.
      if (!signal.aborted) location.hash = toHome(id);
    });
  });
  return form;
}
