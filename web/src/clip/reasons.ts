// The reasons of a clip's state, in the words of the page.

import type { Clip } from "../types.ts";
import { adviceFor } from "./advice.ts";
import { isPlaced, OF_FILES } from "./plausible.ts";
import { chosenOf } from "./pose.ts";

/** Codes of reasons that ask a person to look at a choice again. */
const WARNINGS = new Set(["choice_of_earlier_lidar_map", "choice_carried_over"]);

/** Codes of reasons whose details speak of poses; the page calls them places. */
const OF_PLACES = new Set(["several_modes", "weak_evidence", "not_this_home"]);

/** Codes of doubts that the clip is of this home at all: until they are settled, more clips of the room do not help. */
const OF_HOME = ["no_support", "not_this_home"];

export interface Told {
  code: string;
  text: string;
  isWarning: boolean;
}

/**
 * The reasons of a clip: warnings first, then wrong units and conventions of its files. Of a clip without a place, doubts about the
 * home follow, and then what a person can change.
 */
export function reasonsOf(clip: Clip): Told[] {
  const textOf = (code: string, detail: string) => {
    if (code === "chosen_by_person") return choiceOf(clip, detail);
    if (code === "cancelled") return "a person stopped it";
    const text = OF_PLACES.has(code) ? detail.replace(/\bpose(s?)\b/g, "place$1") : detail;
    return adviceFor(code) !== null ? withoutAdvice(text) : text;
  };
  const told = clip.reasons.map(({ code, detail }) => ({ code, text: textOf(code, detail), isWarning: WARNINGS.has(code) }));
  const rank = ({ code, isWarning }: Told) => {
    if (isWarning) return 0;
    if (OF_FILES.includes(code)) return 1;
    if (isPlaced(clip)) return 2;
    return OF_HOME.includes(code) ? 2 : adviceFor(code) !== null ? 3 : 4;
  };
  return told.sort((a, b) => rank(a) - rank(b));
}

/** The service ends the detail of some reasons with advice; the page gives its own. */
function withoutAdvice(detail: string): string {
  return detail.replace(/; (film|include|record|align|choose|check|send|split|hold|move|switch|is it) [^;]*$/, "");
}

/** The page counts places from 1, the service counts them from 0. */
function choiceOf(clip: Clip, detail: string): string {
  const [then, now] = [clip.choice?.alternative ?? null, chosenOf(clip)];
  if (then === null) return detail;
  return now === null ? `a person chose place ${then + 1} of an earlier answer` : `a person chose place ${now + 1}`;
}
