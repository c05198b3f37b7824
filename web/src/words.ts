// Names of states, stages and figures on the page.

import type { Clip, ClipState, Job, Pose2 } from "./types.ts";

export const STATES: ClipState[] = ["aligning", "queued", "uploaded", "ambiguous", "failed", "aligned"];

const STATE_WORDS: Record<ClipState, string> = {
  uploaded: "Not queued",
  queued: "Queued",
  aligning: "Aligning",
  aligned: "Aligned",
  ambiguous: "Ambiguous",
  failed: "Failed",
};

const STATE_MEANING: Record<ClipState, string> = {
  uploaded: "It waits for a LiDAR map, or its job was cancelled.",
  queued: "It waits for its turn.",
  aligning: "Its place is being computed.",
  aligned: "Its place in the map is known.",
  ambiguous: "Its place is not certain.",
  failed: "It has no place in the map.",
};

/** The order in which a clip goes through them. */
export const STAGES = [
  "decode", "track", "fuse", "label", "floor", "raycast", "search", "refine", "decide", "complete", "report",
];

const STAGE_WORDS: Record<string, string> = {
  decode: "Reading frames",
  track: "Tracking the camera",
  fuse: "Fusing depth",
  label: "Classifying surfaces",
  floor: "Finding the floor",
  raycast: "Virtual LiDAR",
  search: "Searching the map",
  refine: "Refining",
  decide: "Scoring poses",
  complete: "Filling gaps",
  report: "Writing results",
};

export function stateWord(state: ClipState): string {
  return STATE_WORDS[state] ?? state;
}

export function stateMeaning(state: ClipState): string {
  return STATE_MEANING[state] ?? "";
}

export function stageWord(stage: string | null): string {
  return stage ? (STAGE_WORDS[stage] ?? plain(stage)) : "Starting";
}

/** The present work of a job. */
export function jobWord(job: Job): string {
  return job.state === "running" ? `${stageWord(job.stage)} · ${percent(job.progress)}` : "Queued";
}

/** `washing_machine` as people write it. */
export function plain(code: string): string {
  const words = code.replaceAll("_", " ");
  return words.charAt(0).toUpperCase() + words.slice(1);
}

/** Letters of an id that is made of a name: an id has at most 64, and random letters may follow. */
const MOST_LETTERS = 56;

/** The id of a home of this name: "Flat 3, Elm Street" becomes "flat-3-elm-street". */
export function idOf(name: string): string {
  const letters = name.normalize("NFKD").replace(/\p{M}/gu, "").toLowerCase();
  return letters.replace(/[^a-z0-9]+/g, "-").slice(0, MOST_LETTERS).replace(/^-+|-+$/g, "") || "home";
}

/** The name of a clip among the clips of its home; `number` counts from 1. */
export function clipName({ title, file_name }: Pick<Clip, "title" | "file_name">, number: number): string {
  return title ?? file_name ?? (number > 0 ? `Clip ${number}` : "Clip");
}

export function isUnderWay(clip: Clip): boolean {
  return clip.state === "queued" || clip.state === "aligning";
}

export function percent(share: number | null | undefined): string {
  if (share === null || share === undefined || !Number.isFinite(share)) return "–";
  const value = share * 100;
  // 99.97 % must not become a certainty.
  if (value > 99 && value < 100) return "> 99 %";
  return value > 0 && value < 1 ? "< 1 %" : `${Math.round(value)} %`;
}

export function bytes(size: number): string {
  if (size < 1e3) return `${size} B`;
  if (size < 1e6) return `${(size / 1e3).toFixed(0)} kB`;
  return size < 1e9 ? `${(size / 1e6).toFixed(1)} MB` : `${(size / 1e9).toFixed(2)} GB`;
}

export function count(value: number): string {
  if (value < 1e4) return String(value);
  return value < 1e6 ? `${(value / 1e3).toFixed(0)} k` : `${(value / 1e6).toFixed(2)} M`;
}

/** `3 clips`, `1 clip`. */
export function many(value: number, noun: string): string {
  return `${count(value)} ${noun}${value === 1 ? "" : "s"}`;
}

export function seconds(value: number): string {
  if (value < 0.0995) return `${(value * 1000).toFixed(0)} ms`;
  return value < 100 ? `${value.toFixed(value < 10 ? 2 : 1)} s` : `${(value / 60).toFixed(1)} min`;
}

export function metres(value: number): string {
  const size = Math.abs(value);
  return size < 0.995 ? `${(value * 100).toFixed(1)} cm` : `${value.toFixed(2)} m`;
}

export function pose({ x_m, y_m, yaw_rad }: Pose2): string {
  return `x ${x_m.toFixed(2)} m, y ${y_m.toFixed(2)} m, ${degrees(yaw_rad)}`;
}

export function degrees(angle_rad: number): string {
  return `${((angle_rad * 180) / Math.PI).toFixed(1)}°`;
}

const FORMAT = new Intl.DateTimeFormat(undefined, { dateStyle: "medium", timeStyle: "short" });

export function time(timestamp: string): string {
  const date = new Date(timestamp);
  return Number.isNaN(date.getTime()) ? timestamp : FORMAT.format(date);
}
