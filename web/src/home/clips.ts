// The clips of a home at a glance: state, reason, progress, and whether their points are shown.

import { deleteClip } from "../api.ts";
import { adviceOn } from "../clip/advice.ts";
import { lastAnswerFigure } from "../clip/last.ts";
import { reasonsOf } from "../clip/reasons.ts";
import { css } from "../cloud/colours.ts";
import { h, keepFocus, putAgain } from "../dom.ts";
import { confirm } from "../parts/dialog.ts";
import { stateBadge } from "../parts/marks.ts";
import { attempt, say } from "../parts/notices.ts";
import { thumbnail } from "../parts/thumbnail.ts";
import { toClip } from "../route.ts";
import { mayChange } from "../session.ts";
import type { Clip, ClipState, Job } from "../types.ts";
import {
  clipStateMeaning, clipStateWord, isUnderWay, jobWord, levelWord, many, named, percent, STATES, stateTitle, stateWord, time,
} from "../words.ts";
import type { HomeData } from "./data.ts";
import { type Looks, put } from "./looks.ts";

/** Older clips are folded away: on a phone the objects of a home lie below its clips. */
const MOST_ROWS = 30;

interface Row {
  drawn: string;
  element: HTMLElement;
  show: HTMLInputElement;
  /** The reason why the clip cannot be switched on and off; null if it can. */
  reason: string | null;
  bar: HTMLProgressElement;
  stage: HTMLElement;
}

export class ClipsPanel {
  readonly element: HTMLElement;
  private readonly filters = h("div", { class: "row filters", role: "group", "aria-label": "Show clips by state" });
  private readonly list = h("ul", { class: "clips" });
  private readonly said = h("p", { class: "hidden-text", role: "status", "aria-live": "polite" });
  private readonly showAll = h("button", { type: "button", class: "small" });
  private readonly more = h("li", {}, this.showAll);
  private readonly rows = new Map<string, Row>();
  private readonly states = new Map<string, ClipState>();

  constructor(
    private readonly data: HomeData,
    private readonly looks: Looks,
    private readonly onDeleted: () => void,
  ) {
    this.element = h("div", {}, this.filters, this.list, this.said);
    looks.onChange(() => this.drawSwitches());
    this.showAll.addEventListener("click", () => this.unfold());
    this.draw();
  }

  draw(): void {
    const { clips } = this.data;
    this.tellChanges(clips);
    const counts = STATES.map((state) => [state, clips.filter((clip) => clip.state === state).length] as const);
    const present = counts.filter(([, count]) => count > 0);
    // The last clip of a state may have got another one.
    const filter = present.some(([state]) => state === this.looks.clips) ? this.looks.clips : null;
    this.drawFilters(present, clips.length, filter);
    const wanted = clips.filter((clip) => !filter || clip.state === filter).reverse();
    const shown = this.looks.hasAllClips ? wanted : wanted.slice(0, MOST_ROWS);
    const rows = shown.map((clip) => this.row(clip));
    const text = `Show ${many(wanted.length - shown.length, "older clip")}`;
    if (this.showAll.textContent !== text) this.showAll.textContent = text;
    if (wanted.length > shown.length) rows.push(this.more);
    if (clips.length === 0) {
      const advice = mayChange() ? " Press “Add clips”, or drop recordings with depth anywhere on this page." : "";
      putAgain(this.list, h("li", { class: "hint" }, `No clips yet.${advice}`));
    } else if (!sameChildren(this.list, rows)) {
      keepFocus(this.list, () => this.list.replaceChildren(...rows));
    }
    for (const id of this.rows.keys()) if (!clips.some((clip) => clip.id === id)) this.rows.delete(id);
    this.drawSwitches();
  }

  /** Moves the bar of a clip without drawing anything again. */
  progress(clip: string, job: Job): void {
    const row = this.rows.get(clip);
    if (!row) return;
    row.bar.value = job.progress;
    row.stage.textContent = jobWord(job);
  }

  /** Shows all clips. The focus goes to the first one that was folded away. */
  private unfold(): void {
    const first = this.list.children.length - 1;
    this.looks.change((looks) => (looks.hasAllClips = true));
    this.draw();
    this.list.children[first]?.querySelector<HTMLElement>(".title")?.focus({ preventScroll: true });
  }

  /** The surface has no clips. */
  private drawSwitches(): void {
    for (const { show, reason } of this.rows.values()) {
      show.disabled = reason !== null || this.looks.isSurface;
      show.title = reason ?? (this.looks.isSurface ? "The surface shows all clips" : "Show in the map");
    }
  }

  private tellChanges(clips: Clip[]): void {
    clips.forEach((clip) => {
      const before = this.states.get(clip.id);
      if (before && before !== clip.state) this.said.textContent = `${named(this.data.nameOf(clip))}: ${clipStateWord(clip)}`;
      this.states.set(clip.id, clip.state);
    });
  }

  private drawFilters(present: (readonly [ClipState, number])[], all: number, filter: ClipState | null): void {
    if (present.length < 2) return this.filters.replaceChildren();
    const chip = (state: ClipState | null, word: string, count: number) => {
      const button = h("button", { type: "button", class: "chip", "data-key": state ?? "all", title: state && stateTitle(state) },
        word, h("span", { class: "hint" }, count));
      button.setAttribute("aria-pressed", String(filter === state));
      button.addEventListener("click", () => {
        this.looks.change((looks) => (looks.clips = state));
        this.draw();
      });
      return button;
    };
    const chips = present.map(([state, count]) => chip(state, stateWord(state), count));
    putAgain(this.filters, chip(null, "All", all), ...chips);
  }

  private row(clip: Clip): HTMLElement {
    const inMap = this.isInMap(clip.id);
    const { job: _, updated_at: __, ...lasting } = clip;
    const drawn = JSON.stringify([lasting, this.data.indexOf(clip.id), inMap, this.data.hasLevels, this.sameAs(clip)]);
    const old = this.rows.get(clip.id);
    if (old && old.drawn === drawn) {
      if (clip.job) this.progress(clip.id, clip.job);
      return old.element;
    }
    const row = this.make(clip, inMap, drawn);
    this.rows.set(clip.id, row);
    if (clip.job) this.progress(clip.id, clip.job);
    return row.element;
  }

  private isInMap(id: string | null): boolean {
    return this.data.map?.clips.some(({ clip }) => clip === id) ?? false;
  }

  /** The note of a clip whose file the home has already; null for any other. */
  private sameAs({ id, duplicate_of }: Clip): string | null {
    const twin = this.data.clips.find((clip) => clip.id === duplicate_of);
    if (!twin) return null;
    const isUsed = this.isInMap(twin.id) && !this.isInMap(id);
    return `Same recording as ${named(this.data.nameOf(twin))}${isUsed ? ", which the map uses" : ""}`;
  }

  private make(clip: Clip, inMap: boolean, drawn: string): Row {
    const name = this.data.nameOf(clip);
    const bar = h("progress", { max: 1, value: 0, "aria-label": `Progress of ${name}` });
    const stage = h("span", { class: "hint" });
    const show = h("input", {
      type: "checkbox", checked: !this.looks.hiddenClips.has(clip.id), "data-key": `show ${clip.id}`,
      "aria-label": `Show ${name} in the map`,
    });
    show.style.accentColor = css(this.data.colourOf(clip.id));
    show.addEventListener("change", () => this.looks.change((looks) => put(looks.hiddenClips, clip.id, !show.checked)));
    const remove = h("button", { type: "button", class: "quiet icon", title: "Delete", "data-key": `delete ${clip.id}` }, "✕");
    remove.setAttribute("aria-label", `Delete ${name}`);
    remove.addEventListener("click", () => void this.remove(clip, name, remove));
    const [reason] = reasonsOf(clip);
    const isKnown = clip.state === "aligned" || isUnderWay(clip);
    // A queued clip has a reason if a fault of the service holds it up.
    const why = clip.state === "aligning" ? null : (reason?.text ?? (isKnown ? null : clipStateMeaning(clip)));
    const sure = clip.state === "aligned" ? (clip.choice ? "by hand" : `${percent(clip.alignment?.probability)} sure`) : null;
    const levelId = this.data.hasLevels ? this.data.levelOf(clip) : null;
    const level = levelId && levelWord(levelId);
    const same = this.sameAs(clip);
    const when = [sure, level, time(clip.recorded_at ?? clip.created_at), many(clip.info.frames, "frame")];
    const advice = adviceOn(clip, reason?.code);
    const last = lastAnswerFigure(clip);
    const title = h("a", { class: "title", title: name, dir: "auto", href: toClip(clip.home, clip.id), "data-key": `title ${clip.id}` }, name);
    const element = h("li", { class: `clip ${clip.state}`, "data-clip": clip.id },
      // The title is the same link.
      h("a", { href: toClip(clip.home, clip.id), tabindex: -1, "aria-hidden": "true" }, thumbnail(clip, name)),
      h("div", { class: "clip-head" },
        show, title, stateBadge(clip),
        mayChange() && remove),
      h("p", { class: "when hint" }, when.filter(Boolean).join(" · ")),
      same ? h("p", { class: "same hint", title: same }, same) : null,
      clip.state === "aligning" ? h("p", { class: "progress" }, bar, stage) : null,
      last ? h("p", { class: "hint" }, last) : null,
      why ? h("p", { class: reason?.isWarning ? "reason warning" : "reason" }, why) : null,
      advice ? h("p", { class: "advice" }, advice) : null);
    return { drawn, element, show, reason: inMap ? null : "Not in the map", bar, stage };
  }

  private async remove(clip: Clip, name: string, button: HTMLButtonElement): Promise<void> {
    const text = "Its recording, its place and its points are removed for good, and the map is rebuilt without it.";
    if (!(await confirm(`Delete ${named(name)}?`, text, "Delete clip"))) return;
    await attempt(button, async () => {
      await this.data.deleting(clip.id, () => deleteClip(clip));
      say(`${named(name)} is deleted.`);
      this.onDeleted();
    });
  }
}

function sameChildren(parent: Element, children: Element[]): boolean {
  return parent.children.length === children.length && children.every((child, i) => parent.children[i] === child);
}
