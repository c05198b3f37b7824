// The reasons for which a person should look at a home, the homes that need it first, and the next step of one without clips.

import type { Home, List } from "../types.ts";
import { many } from "../words.ts";

type Reasons = Pick<Home, "needs_attention" | "clips_by_state" | "lidar_map_revision">;

/** The reasons of a home in words, with the next step. */
export function attentionOf({ needs_attention, clips_by_state, lidar_map_revision }: Reasons): string[] {
  const { uploaded, ambiguous, failed } = clips_by_state;
  const words: Record<string, string> = {
    waiting: lidar_map_revision === null
      ? `${many(uploaded, "clip")} ${uploaded === 1 ? "waits" : "wait"} for the LiDAR map: add it`
      : `${many(uploaded, "clip")} ${uploaded === 1 ? "was" : "were"} stopped: find ${uploaded === 1 ? "its place" : "their places"} again`,
    ambiguous: `${many(ambiguous, "clip")} ${ambiguous === 1 ? "has" : "have"} no certain place: choose it, or film again`,
    failed: `${many(failed, "clip")} ${failed === 1 ? "has" : "have"} no place: see why`,
    service_fault: "clips wait because of a fault of the service, which tries again: if it lasts, tell the operator",
    map_failing: "the map cannot be made: tell the operator of the service",
  };
  // A newer service may have other reasons.
  return needs_attention.map((reason) => words[reason] ?? reason.replaceAll("_", " "));
}

/** The next step of a home that nobody has filmed; null for a home with clips: its clips have their own advice. */
export function nextStepOf({ clips, lidar_map_revision }: Pick<Home, "clips" | "lidar_map_revision">): string | null {
  if (clips > 0) return null;
  return lidar_map_revision === null ? "Add the LiDAR map of the robot vacuum" : "Film the rooms and add the clips";
}

/** The homes that need attention, then the others; each part in its order. */
export function attentionFirst(homes: readonly Home[]): Home[] {
  const needs = ({ needs_attention }: Home) => needs_attention.length > 0;
  return [...homes.filter(needs), ...homes.filter((home) => !needs(home))];
}

/** The first page of a list, before it the homes of all pages that need attention. */
export function withAttention(page: List<Home>, urgent: List<Home>): List<Home> {
  const ids = new Set(urgent.items.map(({ id }) => id));
  return { items: attentionFirst([...urgent.items, ...page.items.filter(({ id }) => !ids.has(id))]), next: page.next };
}
