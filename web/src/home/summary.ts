// Figures of the map at the foot of the stage, and the next step while there is no map.

import { h, put } from "../dom.ts";
import { mayChange } from "../session.ts";
import type { Clip } from "../types.ts";
import { count, isUnderWay, many, percent } from "../words.ts";
import type { HomeData } from "./data.ts";
import type { Looks } from "./looks.ts";

const STATE_WORDS = { current: "", due: " · being rebuilt", failing: " · could not be rebuilt, the service tries again" };

export class Summary {
  readonly figures = h("p", { class: "stage-facts" });
  /** Lies over the stage while the shown level has no points. */
  readonly empty = h("div", { class: "stage-empty" });

  constructor(
    private readonly data: HomeData,
    private readonly looks: Looks,
  ) {
    looks.onChange(() => this.draw());
    this.draw();
  }

  draw(): void {
    const { data, looks } = this;
    const { map, lidar } = data;
    const clips = map?.clips.filter(({ level }) => level === data.level).length ?? 0;
    const seen = data.coverage ? ` · explains ${percent(data.coverage.seen)} of the LiDAR map` : "";
    this.figures.textContent = map
      ? `Map ${map.revision} · ${count(map.info.points)} points · ${many(clips, "clip")}${seen}${STATE_WORDS[map.state]}`
      : "";
    const hasPoints = (map?.info.points ?? 0) > 0;
    const isPlanEnough = looks.view === "2d" && lidar !== null && data.clips.length > 0 && !isBeingMade(data);
    put(this.empty, ...(hasPoints ? [] : nextStep(data)));
    this.empty.hidden = hasPoints || isPlanEnough;
  }
}

/** True if a clip of the shown level has its place, and no map has the clip yet. */
export function isBeingMade(data: Pick<HomeData, "clips" | "map" | "level" | "levelOf">): boolean {
  const { clips, map, level } = data;
  const isIn = ({ id }: Clip) => map?.clips.some(({ clip }) => clip === id) ?? false;
  return clips.some((clip) => clip.state === "aligned" && !isIn(clip) && (map === null || data.levelOf(clip) === level));
}

function nextStep(data: HomeData): HTMLElement[] {
  const { home, lidar, clips, map, level } = data;
  if (!map && home.map_state === "failing") {
    return said("The map could not be made",
      "The service tries again by itself. If this stays, tell the person who runs it: its log has the cause.");
  }
  if (isBeingMade(data)) return said("The map is being made", "It appears here in a moment.");
  if (clips.some(isUnderWay)) {
    return said("The clips are being aligned", "The map appears here as soon as the first clip has found its place.");
  }
  if (!mayChange()) return [h("h2", {}, "No fused map yet")];
  if (map && clips.length === 0) return said("No clips yet", "Film the home. Then press “Add clips”, or drop the files here.");
  if (map) return said(`No clip of the level ${level}`, "Film on this level. Then press “Add clips”, or drop the files here.");
  if (!lidar) {
    return said(clips.length === 0 ? "This home is empty" : "No fused map yet",
      "Press “Add LiDAR map”, or drop the map of the robot vacuum here: Valetudo JSON, a zip of a ROS map, CSV or PLY points.");
  }
  return said("No fused map yet", clips.length === 0
    ? "Press “Add clips”, or drop zips of RGB-D recordings here."
    : "No clip has a certain place. Open a clip to see why, or to choose its place yourself.");
}

function said(title: string, advice: string): HTMLElement[] {
  return [h("h2", {}, title), h("p", {}, advice)];
}
