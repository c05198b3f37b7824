// The reasons of a clip's state, in the words of the page.

import type { Clip } from "../types.ts";
import { chosenOf } from "./pose.ts";

/** Codes of reasons that ask a person to look at a choice again. */
const WARNINGS = new Set(["choice_of_earlier_lidar_map", "choice_carried_over"]);

export interface Told {
  code: string;
  text: string;
  isWarning: boolean;
}

/** The reasons of a clip, warnings first. */
export function reasonsOf(clip: Clip): Told[] {
  const told = clip.reasons.map(({ code, detail }) => ({
    code, text: code === "chosen_by_person" ? choiceOf(clip, detail) : detail, isWarning: WARNINGS.has(code),
  }));
  return told.sort((a, b) => Number(b.isWarning) - Number(a.isWarning));
}

/** The page counts places from 1, the service counts them from 0. */
function choiceOf(clip: Clip, detail: string): string {
  const [then, now] = [clip.choice?.alternative ?? null, chosenOf(clip)];
  if (then === null) return detail;
  return now === null ? `a person chose place ${then + 1} of an earlier answer` : `a person chose place ${now + 1}`;
}
