// Links to the files of a home, of the level that is shown.

import { homePath } from "../api.ts";
import { h, put } from "../dom.ts";
import { fileLink } from "../parts/download.ts";
import type { HomeData } from "./data.ts";
import { FILES, FOR, type HomeFile } from "./files.ts";

export class Downloads {
  readonly element = h("div", { class: "download-groups" });
  private drawn = "";

  constructor(private readonly data: HomeData) {
    this.draw();
  }

  draw(): void {
    const { map, clips, lidar, level, hasLevels } = this.data;
    const isThere = { map: map !== null && map.info.points > 0, lidar: lidar !== null, anything: clips.length > 0 || lidar !== null };
    // A new revision has the same links, and one of them may have the focus.
    const drawn = JSON.stringify([isThere, level, hasLevels]);
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    const files = FILES.filter(({ needs }) => isThere[needs]);
    if (files.length === 0) return put(this.element, h("p", { class: "hint" }, "Files appear with the LiDAR map and the first clip."));
    put(this.element, ...FOR.flatMap((group) => {
      const rows = files.filter((file) => file.group === group);
      return rows.length > 0 ? [h("h3", {}, group), h("ul", { class: "downloads" }, ...rows.map((file) => this.link(file)))] : [];
    }));
  }

  private link({ word, format, path, ofLevel }: HomeFile): HTMLElement {
    const { home, level, hasLevels } = this.data;
    const encoded = encodeURIComponent(level);
    const parts = path.map((part) => part.replace("{level}", encoded));
    const address = homePath(home.id, ...parts);
    const of = ofLevel && hasLevels ? `${address.includes("?") ? "&" : "?"}level=${encoded}` : "";
    const stem = parts.join("-").split("?")[0]?.replace(/\.\w+$/, "");
    const name = `${home.id}-${stem}${of ? `-${level}` : ""}.${format.toLowerCase()}`;
    return h("li", {}, fileLink(home.id, address + of, name, word), h("span", { class: "hint" }, format));
  }
}
