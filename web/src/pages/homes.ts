// All homes.

import { homePath, homes, makeHome, Refusal } from "../api.ts";
import { h, put } from "../dom.ts";
import { stateMark } from "../parts/marks.ts";
import { attempt } from "../parts/notices.ts";
import { type Asked, toHome, toHomes } from "../route.ts";
import { mayChange } from "../session.ts";
import type { Home, List } from "../types.ts";
import { many, STATES, stateWord, time } from "../words.ts";
import { type Place, setCrumbs } from "./page.ts";

export async function showHomes(place: Place, asked: Asked): Promise<void> {
  setCrumbs(place, [], "Homes");
  const page = await homesOrNone(asked, place.signal);
  if (!page) return put(place.main, oneHome());
  const isPart = Boolean(asked.text || asked.attention || asked.after);
  const list = page.items.length === 0
    ? nothing(isPart)
    : h("ul", { class: "homes" }, ...page.items.map(card));
  const more = page.next && h("a", { class: "button", href: toHomes({ ...asked, after: page.next }) }, "More homes");
  put(place.main, h("div", { class: "page" },
    h("div", { class: "head" }, h("h1", {}, "Homes"), mayChange() && newHome()),
    page.items.length > 0 || isPart ? search(asked) : null,
    list, h("p", { class: "row" }, more)));
}

/** Null for a key of one home, which the service does not name. */
async function homesOrNone(asked: Asked, signal: AbortSignal): Promise<List<Home> | null> {
  try {
    return await homes(asked, signal);
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
      h("h2", {}, "No home like this"), h("a", { class: "button", href: toHomes() }, "All homes"));
  }
  return h("section", { class: "empty" },
    h("h2", {}, "No home yet"),
    h("p", {}, "A home holds the LiDAR map of its robot vacuum and the clips filmed in it."),
    mayChange() && h("p", {}, "Make one above, or let ", h("code", {}, "viola demo"), " fill a server with a simulated one."));
}

function search(asked: Asked): HTMLElement {
  const text = h("input", {
    type: "search", value: asked.text, placeholder: "Search homes", "aria-label": "Search homes", maxlength: 200,
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
  const picture = home.lidar_map_revision
    ? h("img", {
        class: "paper", alt: "", loading: "lazy", decoding: "async",
        src: homePath(home.id, "lidar-map", "image.png"),
      })
    : h("span", { class: "hint" }, "No LiDAR map yet");
  // A home of several levels may have none of the name `main`.
  picture.addEventListener("error", () => picture.remove());
  return h("li", {},
    h("a", { class: "card home-card", href: toHome(home.id) },
      h("span", { class: "thumbnail" }, picture),
      h("span", { class: "card-text" },
        h("strong", {}, home.name || home.id),
        home.name ? h("code", { class: "hint" }, home.id) : null,
        h("span", { class: "hint" }, `${many(home.clips, "clip")} · ${time(home.updated_at)}`),
        states(home))));
}

/** The number of clips in each state that has any. */
function states(home: Home): HTMLElement {
  const counts = STATES.filter((state) => home.clips_by_state[state] > 0);
  return h("span", { class: "row states" }, ...counts.map((state) => {
    const count = home.clips_by_state[state];
    return h("span", { class: `badge ${state}` }, stateMark(state), `${count} ${stateWord(state).toLowerCase()}`);
  }));
}

function newHome(): HTMLElement {
  const name = h("input", {
    name: "name", required: true, placeholder: "Flat 3, Elm Street", autocomplete: "off", maxlength: 200,
    "aria-label": "Name of the new home",
  });
  const button = h("button", { class: "primary" }, "New home");
  const form = h("form", { class: "new-home" }, name, button);
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    void attempt(button, async () => {
      const home = await makeHome(name.value.trim());
      if (home) location.hash = toHome(home.id);
    });
  });
  return form;
}
