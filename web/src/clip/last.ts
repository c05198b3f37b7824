// The answer that the page of a clip shows: the newest one, or that of an earlier job while the newest job has none.

import type { Clip } from "../types.ts";
import { isUnderWay, percent } from "../words.ts";

/** True if the shown answer is that of an earlier job. */
export function isLast({ alignment, last_answer }: Clip): boolean {
  return !!last_answer && (alignment === null || alignment === last_answer.alignment);
}

/** True if the shown answer is that of an earlier job, to an earlier LiDAR map: its poses are in the frame of that map. */
export function isOfEarlierMap(clip: Clip): boolean {
  return isLast(clip) && clip.job !== null && clip.last_answer?.lidar_map_revision !== clip.job.lidar_map_revision;
}

/** The clip with the answer that is shown. Its state and its reasons stay those of the newest job. */
export function withShownAnswer(clip: Clip): Clip {
  return isLast(clip) ? { ...clip, alignment: clip.last_answer?.alignment ?? null } : clip;
}

/** Names the shown answer in the addresses of its files, so that no browser shows the file of another one. */
export function answerName(clip: Clip): string {
  const job = clip.job?.id ?? "";
  return isLast(clip) ? `before-${job}` : job;
}

/** Tells on the page of a clip that the shown answer is not the newest job's; null if it is. */
export function lastAnswerNote(clip: Clip): string | null {
  if (!isLast(clip)) return null;
  const source = isOfEarlierMap(clip) ? ", from the previous LiDAR map," : "";
  const now = isUnderWay(clip) ? "The clip is being placed again." : "The newest attempt gave no answer.";
  return `The last answer${source} is shown below. ${now}`;
}

/** The last answer in the list of clips; null if the newest job has one. */
export function lastAnswerFigure(clip: Clip): string | null {
  if (!isLast(clip)) return null;
  const sure = clip.choice ? "by hand" : `${percent(clip.last_answer?.alignment.probability)} sure`;
  const source = isOfEarlierMap(clip) ? ", from the previous map" : "";
  return `Last answer: ${sure}${source}${isUnderWay(clip) ? ", being placed again" : ""}`;
}
