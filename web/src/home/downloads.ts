// The files of a home, for other programs.

import { homePath } from "../api.ts";
import { h, put } from "../dom.ts";
import type { HomeData } from "./data.ts";

/** What each file is for, and its path below the home. */
const MAP_FILES: [string, string, string[]][] = [
  ["Floor plan, vector", "SVG", ["map", "plan?format=svg"]],
  ["Floor plan, picture", "PNG", ["map", "plan?format=png"]],
  ["Floor plan for maps", "GeoJSON", ["map", "plan?format=geojson"]],
  ["Surface for 3D programs", "GLB", ["map", "mesh?format=glb"]],
  ["Surface for phones", "USDZ", ["map", "mesh?format=usdz"]],
  ["Points with classes", "PLY", ["map", "points?format=ply"]],
  ["Points for 3D programs", "GLB", ["map", "points?format=glb"]],
  ["Objects", "JSON", ["map", "objects"]],
  ["Rooms", "JSON", ["map", "rooms"]],
];

export class Downloads {
  readonly element = h("ul", { class: "downloads" });
  private drawn = "";

  constructor(private readonly data: HomeData) {
    this.draw();
  }

  draw(): void {
    const { map, home, clips, lidar } = this.data;
    const drawn = JSON.stringify([map?.revision, clips.length > 0, lidar !== null]);
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    const files: [string, string, string[]][] = map ? [...MAP_FILES] : [];
    if (clips.length > 0 || lidar) files.push(["Everything, with recordings", "ZIP", ["export"]]);
    const link = ([what, format, path]: [string, string, string[]]) => {
      const name = `${home.id}-${path.join("-").split("?")[0]}.${format.toLowerCase()}`;
      return h("li", {}, h("a", { href: homePath(home.id, ...path), download: name }, what),
        h("span", { class: "hint" }, format));
    };
    put(this.element, ...(files.length > 0 ? files.map(link) : [h("li", { class: "hint" }, "Nothing to download yet.")]));
  }
}
