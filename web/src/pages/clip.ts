// One clip: where it is, why that is believed, and what a person may do about it.

import * as api from "../api.ts";
import { adviceOf } from "../clip/advice.ts";
import { alternatives, type Ground, headingOf } from "../clip/alternatives.ts";
import { answer, files, recording, stages, technical } from "../clip/facts.ts";
import { ClipCloud } from "../clip/cloud.ts";
import { answerName, isLast, isOfEarlierMap, lastAnswerNote, withShownAnswer } from "../clip/last.ts";
import { overlayInWords } from "../clip/overlay.ts";
import { hasWrongFiles, isDoubtful, isForeign, mayLieElsewhere } from "../clip/plausible.ts";
import { reasonsOf } from "../clip/reasons.ts";
import { h, put, putAgain } from "../dom.ts";
import { addressOf, inkOf } from "../paper.ts";
import { askText, confirm } from "../parts/dialog.ts";
import { Backoff, whenDue } from "../parts/backoff.ts";
import { Followed, onHomeChange, type Repeated } from "../parts/live.ts";
import { stateBadge } from "../parts/marks.ts";
import { attempt, say } from "../parts/notices.ts";
import { thumbnail, whenMissing } from "../parts/thumbnail.ts";
import { wordsFor } from "../problems.ts";
import { toClip, toHome, toHomes } from "../route.ts";
import { mayChange } from "../session.ts";
import { isDark, onTheme } from "../theme.ts";
import type { Clip, ClipState, Home } from "../types.ts";
import { clipName, clipStateMeaning, clipStateWord, isUnderWay, jobWord, named, percent } from "../words.ts";
import { keepUpToDate, type Place, setCrumbs } from "./page.ts";

const FOREIGN = "No place in this home explains it.";
/** The form of the ids of clips; no clip has another one. */
const ID = /^[\da-f]{8}-?([\da-f]{4}-?){3}[\da-f]{12}$/i;
/** Of the name of a clip. */
const MOST_LETTERS = 200;

export async function showClip(place: Place, home: string, id: string): Promise<void> {
  const { signal } = place;
  setCrumbs(place, [{ word: "Homes", href: toHomes() }, { word: home, href: toHome(home) }], "Clip");
  if (!ID.test(id)) throw new api.Refusal(404, wordsFor("urn:viola:problem:clip-not-found") ?? "");
  const [first, of] = await Promise.all([api.clip(home, id, signal), api.home(home, signal)]);
  // Only a clip without a name of its own has a number, and a twin has a name. The list of a large home is long on a slow line.
  const all = first.file_name === null || first.duplicate_of !== null ? await api.clips(home, signal) : [];
  const numberOf = (clip: Clip) => all.findIndex(({ id }) => id === clip.id) + 1;
  const twin = all.find(({ id }) => id === first.duplicate_of);
  new ClipPage(place, of, first, numberOf(first), twin ? clipName(twin, numberOf(twin)) : null).show();
}

class ClipPage {
  private ground: Ground = noGround();
  private readonly ofGround = new Backoff();
  /** The reading of the ground: the next one waits for it, and the page for none. A picture may take long on its way. */
  private reading = Promise.resolve();
  private drawn = "";
  /** Names the shown answer. */
  private answer = "";
  private state: ClipState | null = null;
  private readonly head = h("div", {});
  private readonly verdict = h("section", { class: "verdict" });
  private readonly places = h("section", {});
  private readonly rest = h("div", { class: "columns" });
  private readonly pictures = h("section", {});
  private readonly cloud: ClipCloud;
  private readonly bar = h("progress", { max: 1, value: 0, "aria-label": "Progress" });
  private readonly stage = h("span", { class: "hint" });
  /** Tells each new state to screen readers; the figures of the progress would be too many. */
  private readonly said = h("p", { class: "hidden-text", role: "status" });
  /** The reason that the page is not up to date. */
  private readonly lost = h("p", { class: "reason", role: "status" });
  private readonly repeated: Repeated;
  /** True while the clip is deleted here: its event may come before the answer. */
  private isDeleted = false;

  constructor(
    private readonly place: Place,
    private readonly home: Home,
    private clip: Clip,
    /** The number of the clip in its home, from 1; 0 for a clip with a file name. */
    private readonly number: number,
    /** The name of the oldest clip with the same file; null if this is it. */
    private readonly twin: string | null,
  ) {
    const { signal } = place;
    this.cloud = new ClipCloud(signal, place.again);
    const followed = new Followed(
      (job) => {
        this.bar.value = job.progress;
        this.stage.textContent = jobWord(job);
      },
      () => this.repeated.again(),
      signal,
    );
    this.repeated = keepUpToDate(place, {
      read: () => api.clipIfThere(clip.home, clip.id, signal),
      show: (found) => {
        if (!found) return this.leave(), null;
        this.clip = found;
        this.draw();
        followed.follow(isUnderWay(found) && found.job ? [found.job] : []);
        return null;
      },
      tell: (failure) => (this.lost.textContent = failure),
    });
  }

  /** Shows the home of the clip, which is gone: deleted here, or by somebody else. */
  private leave(): void {
    if (!this.isDeleted) say(`${named(this.name)} was deleted in another tab or by another person.`);
    location.hash = toHome(this.clip.home);
  }

  private get name(): string {
    return clipName(this.clip, this.number);
  }

  /** The clip with the answer that is shown. */
  private get shown(): Clip {
    return withShownAnswer(this.clip);
  }

  show(): void {
    const { place, clip } = this;
    put(place.main, h("div", { class: "page clip-page" },
      this.lost, this.said, this.head, this.verdict, this.places, this.pictures, this.cloud.element, this.rest));
    onTheme(() => {
      // A picture of the other theme may still come; it goes into the earlier ground.
      this.ground = { ...this.ground, pictures: new Map() };
      this.drawn = "";
      this.draw();
    }, place.signal);
    this.draw();
    onHomeChange(clip.home, () => this.repeated.again(), place.signal);
  }

  private draw(): void {
    const { job, updated_at: _, ...lasting } = this.clip;
    if (job) {
      this.bar.value = job.progress;
      this.stage.textContent = jobWord(job);
    }
    if (this.state && this.state !== this.clip.state) this.said.textContent = clipStateWord(this.clip);
    this.state = this.clip.state;
    const drawn = JSON.stringify([lasting, job?.id]);
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    const { clip, name } = this;
    const word = this.home.name || clip.home;
    setCrumbs(this.place, [{ word: "Homes", href: toHomes() }, { word, href: toHome(clip.home) }], name);
    // Another job may have aligned it to another LiDAR map.
    if (this.answer !== answerName(clip)) this.ground = noGround();
    this.answer = answerName(clip);
    putAgain(this.head, h("div", { class: "head" },
      h("h1", { dir: "auto" }, name), stateBadge(clip), mayChange() && this.actions(),
      clip.duplicate_of && h("p", { class: "hint" }, "Same recording as ",
        h("a", { href: toClip(clip.home, clip.duplicate_of), "data-key": "twin", dir: "auto" }, this.twin ?? "another clip"))));
    this.drawVerdict();
    const { shown } = this;
    const figures = answer(shown);
    put(this.rest,
      figures && h("section", { class: "card padded" }, h("h2", {}, isLast(clip) ? "Last answer" : "Answer"), figures),
      shown.alignment && h("section", { class: "card padded" }, h("h2", {}, "Time of each step"), stages(shown.alignment.seconds)),
      h("section", { class: "card padded" }, h("h2", {}, "Recording"), recording(clip), files(shown), technical(shown)));
    this.drawPictures();
    this.cloud.show(shown);
    this.drawGround();
  }

  /** Draws the places on the LiDAR maps when these have been read. */
  private drawGround(): void {
    this.reading = this.reading.catch(() => {}).then(async () => {
      await this.readGround();
      if (!this.place.signal.aborted) this.drawPlaces();
    });
  }

  private drawVerdict(): void {
    const { clip } = this;
    const reasons = reasonsOf(clip).map(({ code, text, isWarning }) =>
      h("li", { class: isWarning ? "warning" : "", title: `Reason ${code}` }, text));
    const advice = adviceOf(clip).map((text) => h("p", { class: "advice" }, text));
    put(this.verdict,
      thumbnail(clip, this.name),
      h("div", { class: "verdict-text" },
        clip.state === "aligning" ? h("p", { class: "progress" }, this.bar, this.stage) : null,
        h("p", {}, clip.choice ? "A person chose its place." : isForeign(clip) && !hasWrongFiles(clip) ? FOREIGN : clipStateMeaning(clip)),
        lastAnswerNote(clip) && h("p", {}, lastAnswerNote(clip)),
        reasons.length > 0 ? h("ul", { class: `reasons ${clip.state}` }, ...reasons) : null,
        ...advice));
  }

  private actions(): HTMLElement {
    const { clip, clip: { job } } = this;
    // Buttons that replace each other have the same key.
    const act = (word: string, kind: string, run: () => Promise<void>, key = word) => {
      const button = h("button", { type: "button", class: kind, "data-key": key }, word);
      button.addEventListener("click", () => void attempt(button, run));
      return button;
    };
    const rename = async () => {
      const title = await askText("Name of the clip", clip.title ?? "", "Rename", MOST_LETTERS);
      if (title === null) return;
      await api.renameClip(clip, title || null);
      this.repeated.again();
    };
    const cancel = async (job: string) => {
      await api.cancelJob(job).finally(() => this.repeated.again());
    };
    const again = async () => {
      await api.alignAgain(clip);
      this.repeated.again();
    };
    const withdraw = async () => {
      await api.withdraw(clip);
      say("Choice withdrawn. The clip has its own result again.");
      this.repeated.again();
    };
    const remove = async () => {
      const text = "Its recording, its place and its points are removed for good.";
      if (!(await confirm(`Delete ${named(this.name)}?`, text, "Delete clip"))) return;
      this.isDeleted = true;
      await api.deleteClip(clip).catch((error: unknown) => {
        this.isDeleted = false;
        throw error;
      });
      say(`${named(this.name)} is deleted.`);
      // The person may have gone to another page meanwhile.
      if (!this.place.signal.aborted) location.hash = toHome(clip.home);
    };
    return h("div", { class: "row actions" },
      clip.choice ? act("Withdraw choice", "", withdraw) : null,
      act("Rename", "", rename),
      isUnderWay(clip) ? job && act("Stop", "", () => cancel(job.id), "align") : act("Find its place again", "", again, "align"),
      act("Delete clip", "danger", remove));
  }

  private async readGround(): Promise<void> {
    const { shown: clip, ground, place: { signal } } = this;
    try {
      if (ground.lidars.length === 0) ground.lidars = await api.lidarMaps(clip.home, signal);
      if (clip.alignment) ground.scan ??= await api.scan(clip.home, clip.id, signal);
      const levels = new Set((clip.alignment?.alternatives ?? []).map(({ level }) => level));
      // The service has pictures of the current LiDAR maps only.
      if (isOfEarlierMap(clip)) return;
      for (const { level } of ground.lidars) {
        if (!levels.has(level) || ground.pictures.has(level)) continue;
        const address = await addressOf(await inkOf(api.lidarPath(clip.home, level, "image.png"), isDark(), signal));
        if (signal.aborted) return URL.revokeObjectURL(address);
        signal.addEventListener("abort", () => URL.revokeObjectURL(address), { once: true });
        ground.pictures.set(level, address);
      }
      this.ofGround.reset();
    } catch (error) {
      if (signal.aborted) return;
      // Without the walls the figures remain; a lost request is made again.
      const wait_ms = this.ofGround.next_ms(error);
      if (wait_ms === null) console.warn(error);
      else whenDue(wait_ms, () => this.drawGround(), signal);
    }
  }

  private drawPlaces(): void {
    const { shown: clip, ground } = this;
    const list = clip.alignment?.alternatives ?? [];
    if (list.length === 0) return put(this.places);
    const choose = (index: number, button: HTMLButtonElement) =>
      void attempt(button, async () => {
        const one = list[index];
        if (one && isDoubtful(clip, one) && !(await confirmDoubtful(clip, index, one.probability))) return;
        await api.choose(this.clip, index).finally(() => this.repeated.again());
        say(`Place ${index + 1} chosen. The map is being rebuilt.`);
      });
    putAgain(this.places, h("h2", {}, headingOf(clip)), alternatives(clip, ground, isLast(clip) || isUnderWay(clip) || !mayChange() ? null : choose));
  }

  private drawPictures(): void {
    const { shown: clip } = this;
    if (!clip.alignment) return put(this.pictures);
    const picture = (name: string, title: string, alt: string, shape = "") => {
      const address = `${api.clipPath(clip, name)}?job=${answerName(clip)}`;
      // Photographs are not drawn on paper.
      const image = h("img", { class: shape === "row" ? null : "paper", src: address, alt, loading: "lazy" });
      const figure = h("figure", { class: `card picture ${shape}` }, h("a", { href: address }, image), h("figcaption", {}, title));
      // Not every answer has every picture.
      whenMissing(image, this.place.signal, () => {
        figure.remove();
        if (!this.pictures.querySelector("figure")) put(this.pictures);
      });
      return figure;
    };
    put(this.pictures, h("h2", {}, "Pictures"), h("div", { class: "pictures" },
      clip.state === "aligned" ? null : picture("frames.jpg", "Frames of the recording", "A few frames of the clip, side by side", "row"),
      clip.alignment.hits > 0 && picture("overlay.png",
        // A phone shows its legend too small.
        `The service's own answer over the ${isOfEarlierMap(clip) ? "previous " : ""}LiDAR map. Open the picture to read its legend.`,
        overlayInWords(clip)),
      // Without a filled-in hit the picture says nothing.
      clip.alignment.completion && clip.alignment.completion.hits > 0
        ? picture("completion.png", "Views that were completed because the clip is in doubt",
            "The completed views, and the plan before and after")
        : null));
  }
}

function noGround(): Ground {
  return { lidars: [], pictures: new Map(), scan: null };
}

/** Asks before an improbable place is chosen: a wrong one spoils the map. */
function confirmDoubtful(clip: Clip, index: number, probability: number | null): Promise<boolean> {
  const isWrong = hasWrongFiles(clip);
  const title = probability === null || isWrong ? `Choose place ${index + 1}?` : `Place ${index + 1} is only ${percent(probability)} probable. Choose it?`;
  const doubt = mayLieElsewhere(clip) ? "The clip may be of another home." : "Another place may be the right one.";
  const why = isWrong ? "Units or camera poses of the files are wrong." : doubt;
  const text = `${why} At a wrong place it puts walls and furniture into the map that are not there. ` +
    "Compare the pictures with the place first. You can withdraw the choice later.";
  return confirm(title, text, `Choose place ${index + 1}`);
}
