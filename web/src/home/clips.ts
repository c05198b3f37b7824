// The clips of a home at a glance: state, reason, progress, and whether their points are shown.

import { deleteClip } from "../api.ts";
import { adviceOf } from "../clip/advice.ts";
import { css } from "../cloud/colours.ts";
import { h, put as fill } from "../dom.ts";
import { confirm } from "../parts/dialog.ts";
import { stateBadge } from "../parts/marks.ts";
import { attempt, say } from "../parts/notices.ts";
import { thumbnail } from "../parts/thumbnail.ts";
import { toClip } from "../route.ts";
import type { Clip, ClipState, Job } from "../types.ts";
import { isUnderWay, jobWord, percent, STATES, stateMeaning, stateWord, time } from "../words.ts";
import type { HomeData } from "./data.ts";
import { type Looks, put } from "./looks.ts";

interface Row {
  drawn: string;
  element: HTMLElement;
  bar: HTMLProgressElement;
  stage: HTMLElement;
}

export class ClipsPanel {
  readonly element: HTMLElement;
  private readonly filters = h("div", { class: "row filters", role: "group", "aria-label": "Show clips by state" });
  private readonly list = h("ul", { class: "clips" });
  private readonly said = h("p", { class: "hidden-text", role: "status", "aria-live": "polite" });
  private readonly rows = new Map<string, Row>();
  private readonly states = new Map<string, ClipState>();
  private filter: ClipState | null = null;

  constructor(
    private readonly data: HomeData,
    private readonly looks: Looks,
    private readonly onDeleted: () => void,
  ) {
    this.element = h("div", {}, this.filters, this.list, this.said);
    this.draw();
  }

  draw(): void {
    const { clips } = this.data;
    this.tellChanges(clips);
    const counts = STATES.map((state) => [state, clips.filter((clip) => clip.state === state).length] as const);
    const present = counts.filter(([, count]) => count > 0);
    if (this.filter && !present.some(([state]) => state === this.filter)) this.filter = null;
    this.drawFilters(present, clips.length);
    const shown = clips.filter((clip) => !this.filter || clip.state === this.filter).reverse();
    const rows = shown.map((clip) => this.row(clip));
    if (clips.length === 0) {
      fill(this.list, h("li", { class: "hint" }, "No clips yet. Drop zips of RGB-D recordings anywhere on this page."));
    } else if (!sameChildren(this.list, rows)) {
      this.list.replaceChildren(...rows);
    }
    for (const id of this.rows.keys()) if (!clips.some((clip) => clip.id === id)) this.rows.delete(id);
  }

  /** Moves the bar of a clip without drawing anything again. */
  progress(clip: string, job: Job): void {
    const row = this.rows.get(clip);
    if (!row) return;
    row.bar.value = job.progress;
    row.stage.textContent = jobWord(job);
  }

  private tellChanges(clips: Clip[]): void {
    clips.forEach((clip, i) => {
      const before = this.states.get(clip.id);
      if (before && before !== clip.state) this.said.textContent = `Clip ${i + 1}: ${stateWord(clip.state)}`;
      this.states.set(clip.id, clip.state);
    });
  }

  private drawFilters(present: (readonly [ClipState, number])[], all: number): void {
    if (present.length < 2) return this.filters.replaceChildren();
    const chip = (state: ClipState | null, word: string, count: number) => {
      const button = h("button", { type: "button", class: "chip", "data-state": state ?? "all" },
        word, h("span", { class: "hint" }, count));
      button.setAttribute("aria-pressed", String(this.filter === state));
      button.addEventListener("click", () => {
        this.filter = state;
        this.draw();
        this.filters.querySelector<HTMLElement>(`[data-state=${state ?? "all"}]`)?.focus();
      });
      return button;
    };
    const chips = present.map(([state, count]) => chip(state, stateWord(state), count));
    fill(this.filters, chip(null, "All", all), ...chips);
  }

  private row(clip: Clip): HTMLElement {
    const index = this.data.indexOf(clip.id);
    const inMap = this.data.map?.clips.some((other) => other.clip === clip.id) ?? false;
    const { job: _, updated_at: __, ...lasting } = clip;
    const drawn = JSON.stringify([lasting, index, inMap, this.data.hasLevels]);
    const old = this.rows.get(clip.id);
    if (old && old.drawn === drawn) {
      if (clip.job) this.progress(clip.id, clip.job);
      return old.element;
    }
    const row = this.make(clip, index, inMap, drawn);
    this.rows.set(clip.id, row);
    if (clip.job) this.progress(clip.id, clip.job);
    return row.element;
  }

  private make(clip: Clip, index: number, inMap: boolean, drawn: string): Row {
    const name = `Clip ${index + 1}`;
    const bar = h("progress", { max: 1, value: 0, "aria-label": `Progress of ${name}` });
    const stage = h("span", { class: "hint" });
    const show = h("input", {
      type: "checkbox", checked: !this.looks.hiddenClips.has(clip.id), disabled: !inMap,
      "aria-label": `Show ${name} in the map`, title: inMap ? "Show in the map" : "Not in the map",
    });
    show.style.accentColor = css(this.data.colourOf(clip.id));
    show.addEventListener("change", () => this.looks.change((looks) => put(looks.hiddenClips, clip.id, !show.checked)));
    const remove = h("button", { type: "button", class: "quiet icon", title: "Delete" }, "✕");
    remove.setAttribute("aria-label", `Delete ${name}`);
    remove.addEventListener("click", () => void this.remove(clip, name, remove));
    const reason = clip.reasons[0]?.detail ?? (clip.state === "aligned" ? null : stateMeaning(clip.state));
    const sure = clip.state === "aligned" ? (clip.choice ? "by hand" : `${percent(clip.alignment?.probability)} sure`) : null;
    const level = this.data.hasLevels ? this.data.levelOf(clip) : null;
    const when = [sure, level, time(clip.recorded_at ?? clip.created_at), `${clip.info.frames} frames`];
    const [advice] = adviceOf(clip);
    const element = h("li", { class: `clip ${clip.state}`, "data-clip": clip.id },
      // The title is the same link.
      h("a", { href: toClip(clip.home, clip.id), tabindex: -1, "aria-hidden": "true" }, thumbnail(clip, name)),
      h("div", { class: "clip-head" },
        show, h("a", { class: "title", href: toClip(clip.home, clip.id) }, name), stateBadge(clip.state), remove),
      h("p", { class: "when hint" }, when.filter(Boolean).join(" · ")),
      isUnderWay(clip) ? h("p", { class: "progress" }, bar, stage) : null,
      reason && !isUnderWay(clip) ? h("p", { class: "reason" }, reason) : null,
      advice ? h("p", { class: "advice" }, advice) : null);
    return { drawn, element, bar, stage };
  }

  private async remove(clip: Clip, name: string, button: HTMLButtonElement): Promise<void> {
    const text = "Its recording, its place and its points are removed for good, and the map is made again without it.";
    if (!(await confirm(`Delete ${name.toLowerCase()}?`, text, "Delete clip"))) return;
    await attempt(button, async () => {
      await deleteClip(clip);
      say(`${name} is deleted.`);
      this.onDeleted();
    });
  }
}

function sameChildren(parent: Element, children: Element[]): boolean {
  return parent.children.length === children.length && children.every((child, i) => parent.children[i] === child);
}
