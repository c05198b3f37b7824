// Facts about a clip, in words and figures.

import { h } from "../dom.ts";
import type { Clip } from "../types.ts";
import { bytes, count, metres, percent, plain, pose, seconds, STAGES, stageWord, time } from "../words.ts";

type Fact = [string, string | null | undefined];

function facts(list: Fact[]): HTMLElement {
  const shown = list.filter((fact): fact is [string, string] => !!fact[1]);
  return h("dl", { class: "facts" }, ...shown.flatMap(([word, value]) => [h("dt", {}, word), h("dd", {}, value)]));
}

export function recording(clip: Clip): HTMLElement {
  const { info } = clip;
  const allPosed = info.frames_with_pose === info.frames;
  return facts([
    ["Recorded", clip.recorded_at && time(clip.recorded_at)],
    ["Uploaded", time(clip.created_at)],
    ["Layout", plain(info.layout)],
    ["Frames", allPosed ? count(info.frames) : `${info.frames}, ${info.frames_with_pose} with a pose`],
    ["Length", info.duration_s ? seconds(info.duration_s) : null],
    ["Pictures", `${info.color_width} × ${info.color_height}, depth ${info.depth_width} × ${info.depth_height}`],
    ["Poses", plain(info.pose_convention)],
    ["Gravity", plain(info.gravity)],
    ["Size", bytes(clip.size_bytes)],
    ["Notes", info.notes.join(" ")],
  ]);
}

export function answer(clip: Clip): HTMLElement | null {
  const { alignment, choice } = clip;
  if (!alignment) return null;
  const { level } = choice ?? alignment;
  const at = choice?.map_from_clip ?? alignment.map_from_clip;
  const { floor } = alignment;
  const camera = floor && `${metres(floor.camera_height_m)} above the floor${floor.assumed ? " (assumed)" : ""}`;
  return facts([
    ["Level", level === "main" ? null : level],
    ["Place", at && pose(at)],
    ["Probability", choice ? "chosen by a person" : percent(alignment.probability)],
    ["Loss", alignment.loss_m === null ? null : metres(alignment.loss_m)],
    ["Hits on walls", alignment.inliers === null ? null : `${percent(alignment.inliers)} of ${count(alignment.hits)}`],
    ["Map explained", alignment.coverage === null ? null : percent(alignment.coverage)],
    ["Key frames", count(alignment.key_frames)],
    ["First camera", camera],
    ["Classes by", alignment.labels?.by],
  ]);
}

/** The time of each stage as bars that share one scale. */
export function stages(times: Record<string, number>): HTMLElement {
  const known = Object.entries(times).sort(([a], [b]) => place(a) - place(b));
  const longest = Math.max(1e-6, ...known.map(([, time]) => time));
  const sum = known.reduce((total, [, time]) => total + time, 0);
  const rows = known.map(([stage, time]) => {
    const bar = h("span", { class: "bar-fill" });
    bar.style.width = `${Math.max(0.5, (100 * time) / longest)}%`;
    return h("tr", {},
      h("th", { scope: "row" }, stageWord(stage)),
      h("td", { class: "bar-cell", "aria-hidden": "true" }, bar),
      h("td", { class: "figure" }, seconds(time)));
  });
  return h("table", { class: "stages" },
    h("caption", { class: "hidden-text" }, "Time of each stage"),
    h("tbody", {}, ...rows),
    h("tfoot", {}, h("tr", {},
      h("th", { scope: "row" }, "Together"), h("td"), h("td", { class: "figure" }, seconds(sum)))));
}

function place(stage: string): number {
  const at = STAGES.indexOf(stage);
  return at < 0 ? STAGES.length : at;
}
