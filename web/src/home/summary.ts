// Figures of the map at the foot of the stage, and the next step while there is no map.

import { h, put } from "../dom.ts";
import { mayChange } from "../session.ts";
import type { Clip } from "../types.ts";
import { count, isUnderWay, levelWord, many, percent } from "../words.ts";
import { isOfPreviousLidar, lidarBelow } from "./below.ts";
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
    const seen = data.coverage ? ` · shows ${percent(data.coverage.seen)} of the ${isOfPreviousLidar(data) ? "previous " : ""}LiDAR map` : "";
    const waits = data.clips.some(isUnderWay) && map?.state === "due";
    const state = waits ? ` · rebuilt ${whenMade(data.clips, "after 10 minutes")}` : STATE_WORDS[map?.state ?? "current"];
    const hasPoints = (map?.info.points ?? 0) > 0;
    const later = hasPoints && isOfPreviousLidar(data) && !lidarBelow(data) ? " · the new LiDAR map appears when the map is rebuilt" : "";
    const none = data.hasLevels ? "no clip of this level in it yet" : "no clip in it yet";
    const shown = hasPoints ? `${count(map?.info.points ?? 0)} points · ${many(clips, "clip")}${seen}` : none;
    this.figures.textContent = map ? `Map ${map.revision} · ${shown}${state}${later}` : "";
    const isPlanEnough = looks.view === "2d" && lidar !== null && data.clips.length > 0 && !isBeingMade(data);
    put(this.empty, ...(hasPoints ? [] : nextStep(data)));
    this.empty.hidden = hasPoints || isPlanEnough;
    this.empty.className = lidar ? "stage-empty below-map" : "stage-empty";
  }
}

/**
 * The service makes one map of all clips, and waits until none of them is in the queue or being placed. It waits ten minutes for new
 * clips, since some homes never stop uploading, and most of a day for clips that the newest map has. `latest` tells the ten minutes.
 */
function whenMade(clips: readonly Clip[], latest: string): string {
  const waitsLong = clips.some((clip) => isUnderWay(clip) && clip.placement);
  return `when all clips have settled${waitsLong ? "" : `, or ${latest}`}`;
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
  const underWay = clips.filter(isUnderWay).length;
  if (underWay > 0) {
    const settled = clips.length > underWay ? `: ${many(underWay, "clip")} of ${clips.length} ${underWay === 1 ? "is" : "are"} left` : "";
    return said("The clips are being placed", `The map is made ${whenMade(clips, "10 minutes after the first one")}${settled}.`);
  }
  if (isBeingMade(data)) return said("The map is being made", "All clips have settled. The map appears here by itself.");
  if (!mayChange()) return said("No map of the clips yet", "It appears here when clips with a place are in this home. Your key can only look.");
  if (map && clips.length === 0) return said("No clips yet", "Film the home. Then press “Add clips”, or drop the files here.");
  if (map && map.clips.length > 0) {
    return said(`No clip of the level “${levelWord(level)}”`, "Film on this level. Then press “Add clips”, or drop the files here.");
  }
  if (!lidar) {
    return said(clips.length === 0 ? "This home is empty" : "No LiDAR map yet",
      "Press “Add LiDAR map”, or drop the map of the robot vacuum here: Valetudo JSON, a zip of a ROS map, CSV or PLY points.");
  }
  if (clips.length === 0) return said("No clips yet", "Press “Add clips”, or drop recordings with depth here.");
  return said("No map of the clips yet", "No clip has a certain place. Open a clip to see why, or to choose its place yourself.");
}

function said(title: string, advice: string): HTMLElement[] {
  return [h("h2", {}, title), h("p", {}, advice)];
}
