// Names of states, stages and figures on the page.

import type { Clip, ClipState, Job, Pose2 } from "./types.ts";

export const STATES: ClipState[] = ["aligning", "queued", "uploaded", "ambiguous", "failed", "aligned"];

/** The words of a page; programs use the names of the states. */
const STATE_WORDS: Record<ClipState, string> = {
  uploaded: "Waiting",
  queued: "In the queue",
  aligning: "Being placed",
  aligned: "Placed",
  ambiguous: "Unclear",
  failed: "Not placed",
};

const STATE_MEANING: Record<ClipState, string> = {
  uploaded: "It waits for a LiDAR map, or a person stopped it.",
  queued: "It waits for its turn.",
  aligning: "The service is finding its place in the map.",
  aligned: "Its place in the map is known.",
  ambiguous: "Its place is not certain.",
  failed: "It has no place in the map.",
};

/** The order in which a clip goes through them. */
export const STAGES = [
  "decode", "track", "fuse", "label", "floor", "raycast", "search", "refine", "decide", "complete", "report",
];

const STAGE_WORDS: Record<string, string> = {
  decode: "Reading the recording",
  track: "Following the camera",
  fuse: "Building the surface",
  label: "Recognising things",
  floor: "Finding the floor",
  raycast: "Scanning as the vacuum does",
  search: "Searching the map",
  refine: "Refining the places",
  decide: "Comparing the places",
  complete: "Filling gaps",
  report: "Saving the result",
};

export function stateWord(state: ClipState): string {
  return STATE_WORDS[state] ?? state;
}

export function stateMeaning(state: ClipState): string {
  return STATE_MEANING[state] ?? "";
}

type Stoppable = Pick<Clip, "state" | "reasons">;

/** True if a person stopped the clip, so that it waits for a person and not for a LiDAR map. */
function isStopped({ state, reasons }: Stoppable): boolean {
  return state === "uploaded" && reasons.some(({ code }) => code === "cancelled");
}

export function clipStateWord(clip: Stoppable): string {
  return isStopped(clip) ? "Stopped" : stateWord(clip.state);
}

/** The meaning of a clip's state; its reasons say more. */
export function clipStateMeaning(clip: Stoppable): string {
  if (isStopped(clip)) return "It is not being placed.";
  return clip.state === "uploaded" ? "It waits for a LiDAR map." : stateMeaning(clip.state);
}

/** The meaning of a state with its name in the API, for the title of a badge. */
export function stateTitle(state: ClipState): string {
  return `${stateMeaning(state)} (${state})`;
}

export function stageWord(stage: string | null): string {
  return stage ? (STAGE_WORDS[stage] ?? plain(stage)) : "Starting";
}

/** The present work of a job. */
export function jobWord(job: Job): string {
  return job.state === "running" ? `${stageWord(job.stage)} · ${percent(job.progress)}` : STATE_WORDS.queued;
}

/** `washing_machine` as people write it. */
export function plain(code: string): string {
  const words = code.replaceAll("_", " ");
  return words.charAt(0).toUpperCase() + words.slice(1);
}

/** Letters of an id that is made of a name: an id has at most 64, and random letters may follow. */
const MOST_LETTERS = 56;

/** Latin letters that no Unicode decomposition turns into plain ones. */
const LATIN: Record<string, string> = { ß: "ss", æ: "ae", œ: "oe", ø: "o", đ: "d", ð: "d", ł: "l", þ: "th", ı: "i" };

/**
 * The id that is made of a name: "Flat 3, Elm Street" becomes "flat-3-elm-street". A name without Latin letters or
 * digits becomes `otherwise`.
 */
export function idOf(name: string, most = MOST_LETTERS, otherwise = "home"): string {
  const letters = name.toLowerCase().normalize("NFKD").replace(/\p{M}/gu, "").replace(/[^\x00-\x7f]/g, (letter) => LATIN[letter] ?? letter);
  return letters.replace(/[^a-z0-9]+/g, "-").replace(/^-+/, "").slice(0, most).replace(/-+$/, "") || otherwise;
}

/** The name of a level for people: `first-floor` is "First floor". The service keeps no other name of a level. */
export function levelWord(level: string): string {
  return plain(level.replaceAll("-", " "));
}

/** Hebrew, Arabic and their neighbours. */
const RIGHT_TO_LEFT = /[\u0590-\u08ff\ufb1d-\ufdff\ufe70-\ufefc]/;

/** A person's own words within a sentence: letters from right to left do not turn the words around them. */
export function named(name: string): string {
  return RIGHT_TO_LEFT.test(name) ? `\u2068${name}\u2069` : name;
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

const decimals = new Map<number, Intl.NumberFormat>();

/** A number as this browser's language writes it. Addresses and files have points instead. */
export function decimal(value: number, digits: number): string {
  const format = decimals.get(digits) ??
    new Intl.NumberFormat(undefined, { minimumFractionDigits: digits, maximumFractionDigits: digits, useGrouping: false });
  decimals.set(digits, format);
  // -0.001 would be written as -0.00.
  return format.format(Number(value.toFixed(digits)) === 0 ? 0 : value);
}

export function bytes(size: number): string {
  if (size < 1e3) return `${size} B`;
  // The bounds are those of the rounded numbers: no size is written as 1000 kB.
  if (size < 999_500) return `${decimal(size / 1e3, 0)} kB`;
  return size < 999_950_000 ? `${decimal(size / 1e6, 1)} MB` : `${decimal(size / 1e9, 2)} GB`;
}

export function count(value: number): string {
  if (value < 1e4) return decimal(value, 0);
  return value < 999_500 ? `${decimal(value / 1e3, 0)} k` : `${decimal(value / 1e6, 2)} M`;
}

/** `3 clips`, `1 clip`. */
export function many(value: number, noun: string): string {
  return `${count(value)} ${noun}${value === 1 ? "" : "s"}`;
}

export function seconds(value: number): string {
  if (value < 0.0995) return `${decimal(value * 1000, 0)} ms`;
  return value < 100 ? `${decimal(value, value < 10 ? 2 : 1)} s` : `${decimal(value / 60, 1)} min`;
}

export function metres(value: number): string {
  const size = Math.abs(value);
  return size < 0.995 ? `${decimal(value * 100, 1)} cm` : `${decimal(value, 2)} m`;
}

/** `12.4 m²` */
export function area(value_m2: number): string {
  return `${decimal(value_m2, 1)} m²`;
}

export function pose({ x_m, y_m, yaw_rad }: Pose2): string {
  return `x ${decimal(x_m, 2)} m, y ${decimal(y_m, 2)} m, ${degrees(yaw_rad)}`;
}

export function degrees(angle_rad: number): string {
  return `${decimal((angle_rad * 180) / Math.PI, 1)}°`;
}

const FORMAT = new Intl.DateTimeFormat(undefined, { dateStyle: "medium", timeStyle: "short" });

export function time(timestamp: string): string {
  const date = new Date(timestamp);
  return Number.isNaN(date.getTime()) ? timestamp : FORMAT.format(date);
}
