// All homes.

import { homePath, homes, makeHome } from "../api.ts";
import { h, put } from "../dom.ts";
import { attempt } from "../parts/notices.ts";
import { toHome, toHomes } from "../route.ts";
import type { Home } from "../types.ts";
import { many, time } from "../words.ts";
import { type Place, setCrumbs } from "./page.ts";

export async function showHomes(place: Place, after: string | null): Promise<void> {
  setCrumbs(place, [], "Homes");
  const page = await homes(after, place.signal);
  const form = newHome();
  const isEmpty = page.items.length === 0;
  const list = isEmpty
    ? h("section", { class: "empty" },
        h("h2", {}, after ? "No more homes" : "No home yet"),
        h("p", {}, "A home holds the LiDAR map of its robot vacuum and the clips filmed in it. Make one above, or let ",
          h("code", {}, "viola demo"), " fill a server with a simulated one."))
    : h("ul", { class: "homes" }, ...page.items.map(card));
  const more = page.next && h("a", { class: "button", href: toHomes(page.next) }, "More homes");
  put(place.main, h("div", { class: "page" },
    h("div", { class: "head" }, h("h1", {}, "Homes"), form), list, h("p", { class: "row" }, more)));
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
        h("span", { class: "hint" }, `${many(home.clips, "clip")} · ${time(home.updated_at)}`))));
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
