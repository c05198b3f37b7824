// Facts about a clip, in words and figures.

import { clipPath } from "../api.ts";
import { h } from "../dom.ts";
import { fileLink } from "../parts/download.ts";
import type { Clip } from "../types.ts";
import { bytes, count, levelWord, metres, percent, pose, seconds, STAGES, stageWord, time } from "../words.ts";
import { layoutWord } from "./layouts.ts";
import { chosenOf, poseInForce } from "./pose.ts";

type Fact = [string, string | null | undefined];

function facts(list: Fact[]): HTMLElement {
  return definitions(known(list));
}

/** The facts that have a value. */
function known(list: Fact[]): [string, string][] {
  return list.filter((fact): fact is [string, string] => !!fact[1]);
}

function definitions(shown: [string, string][]): HTMLElement {
  return h("dl", { class: "facts" }, ...shown.flatMap(([word, value]) => [h("dt", {}, word), h("dd", {}, value)]));
}

export function recording(clip: Clip): HTMLElement {
  const { info } = clip;
  const allPosed = info.frames_with_pose === info.frames;
  const colour = info.color_width > 0 && `${info.color_width} × ${info.color_height}`;
  return facts([
    ["Recorded", clip.recorded_at && time(clip.recorded_at)],
    ["Uploaded", time(clip.created_at)],
    ["App or format", layoutWord(info.layout)],
    ["Frames", allPosed ? count(info.frames) : `${count(info.frames)}, ${count(info.frames_with_pose)} with a known camera`],
    ["Length", info.duration_s ? seconds(info.duration_s) : null],
    ["Pictures", [colour, `depth ${info.depth_width} × ${info.depth_height}`].filter(Boolean).join(", ")],
    ["Size", bytes(clip.size_bytes)],
    ["Notes", info.notes.join("; ")],
  ]);
}

/** Names and codes of the API, for the person who looks into a fault. */
export function technical(clip: Clip): HTMLElement {
  const { info, alignment } = clip;
  const list = facts([
    ["Clip", clip.id],
    ["State", clip.state],
    ["Reasons", clip.reasons.map(({ code }) => code).join(", ")],
    ["Last job", clip.job?.id],
    ["Layout", info.layout],
    ["Poses", info.pose_convention],
    ["Gravity", info.gravity],
    ["Intrinsics", info.intrinsics],
    ["Depth", info.depth_unit],
    ["Key frames", alignment && count(alignment.key_frames)],
    ["Classes by", alignment?.labels?.by],
    ["SHA-256", clip.sha256],
  ]);
  return h("details", { class: "technical", "data-key": "technical" }, h("summary", {}, "Technical details"), list);
}

/** True if the clip has points: without a surface, the answer has an empty cloud. */
export function hasPoints({ alignment, reasons }: Clip): boolean {
  const isEmpty = reasons.some(({ code }) => code === "nothing_fused");
  return alignment !== null && !isEmpty && (alignment.labels !== null || alignment.hits > 0);
}

/** Links to the files of a clip. */
export function files(clip: Clip): HTMLElement {
  const link = (word: string, name: string, format: string) =>
    h("li", {}, fileLink(clip.home, clipPath(clip, name), "", word), h("span", { class: "hint" }, format));
  return h("ul", { class: "downloads" },
    link("Download the recording", "recording", bytes(clip.size_bytes)),
    hasPoints(clip) && link("Download the points", "cloud.ply", "PLY"));
}

/** The figures of the answer; null if it has none. */
export function answer(clip: Clip): HTMLElement | null {
  const { alignment, choice } = clip;
  if (!alignment) return null;
  const { floor } = alignment;
  const { level, map_from_clip: at } = poseInForce(clip) ?? alignment;
  const figures = figuresOf(clip, alignment);
  const camera = floor && `${metres(floor.camera_height_m)} above the floor${floor.assumed ? " (assumed)" : ""}`;
  const list = known([
    ["Level", level === "main" ? null : levelWord(level)],
    ["Place", at && pose(at)],
    ["Probability", choice ? "chosen by a person" : alignment.probability === null ? null : percent(alignment.probability)],
    ["Misfit", figures.loss_m === null ? null : metres(figures.loss_m)],
    ["Fits the walls", figures.inliers === null ? null : `${percent(figures.inliers)} of ${count(alignment.hits)} points`],
    ["Of the LiDAR map", figures.coverage === null ? null : `${percent(figures.coverage)} seen`],
    ["First camera", camera],
  ]);
  return list.length > 0 ? definitions(list) : null;
}

type Answer = NonNullable<Clip["alignment"]>;
type Figures = Pick<Answer, "loss_m" | "inliers" | "coverage">;

/** The figures of the pose in force. The answer's own figures are those of its first alternative. */
function figuresOf(clip: Clip, { loss_m, inliers, coverage, alternatives }: Answer): Figures {
  const chosen = chosenOf(clip);
  if (chosen === 0 || !poseInForce(clip)) return { loss_m, inliers, coverage };
  const one = chosen === null ? null : alternatives[chosen];
  return { loss_m: one?.loss_m ?? null, inliers: one?.inliers ?? null, coverage: null };
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
