// One home: its map, its clips, and what is put into it.

import { clipsAtWork } from "../api.ts";
import { h, put } from "../dom.ts";
import { Address } from "../home/address.ts";
import { ClipsPanel } from "../home/clips.ts";
import { Compare } from "../home/compare.ts";
import { HomeData } from "../home/data.ts";
import { CoveragePanel } from "../home/coverage.ts";
import { Details } from "../home/details.ts";
import { Downloads } from "../home/downloads.ts";
import { EarlierMaps } from "../home/earlier.ts";
import { LayersPanel, section } from "../home/layers.ts";
import { Legend } from "../home/legend.ts";
import { Looks } from "../home/looks.ts";
import { Losses } from "../home/losses.ts";
import { RemovedPanel } from "../home/removed.ts";
import { HomeScene } from "../home/scene.ts";
import type { Selection } from "../home/selection.ts";
import { Settings } from "../home/settings.ts";
import { deselectMissing, read, written } from "../home/share.ts";
import { Summary } from "../home/summary.ts";
import { ThingsPanel } from "../home/things.ts";
import { Toolbar } from "../home/toolbar.ts";
import { Followed, onHomeChange, Repeated } from "../parts/live.ts";
import { say } from "../parts/notices.ts";
import { StatusLine } from "../parts/status.ts";
import { parse, toHomes } from "../route.ts";
import { mayChange } from "../session.ts";
import { UploadPanel } from "../upload/panel.ts";
import { isUnderWay } from "../words.ts";
import { keepUpToDate, type Place, setCrumbs } from "./page.ts";

/** Time between two readings of a home whose map is out of date. */
const MERGE_MS = 10_000;
/** Time between two readings of the progress of several jobs. */
const PROGRESS_MS = 2000;
/** As in the style sheet. */
const NARROW = "(max-width: 820px)";

export async function showHome(place: Place, id: string, asked: URLSearchParams): Promise<void> {
  const drawCrumbs = crumbsOf(place);
  drawCrumbs(id);
  const { signal } = place;
  const data = await HomeData.load(id, asked.get("level"), signal);
  if (signal.aborted) return;
  drawCrumbs(data.name);
  const looks = new Looks();
  const framing = read(asked, looks);
  const missing = deselectMissing(asked, data, looks);
  if (missing) say(missing);
  if (!data.map?.info.points && !asked.has("view")) looks.view = "2d";
  const status = new StatusLine("stage-status");
  const scene = new HomeScene(data, looks, (text) => status.show(text), signal);
  const select = (selection: Selection, isByKey: boolean) => {
    looks.select(selection);
    scene.show(selection);
    // The list lies below the map there.
    if (matchMedia(NARROW).matches) stage.scrollIntoView();
    if (isByKey) details.focus();
  };
  const clips = new ClipsPanel(data, looks, () => repeated.again());
  const things = new ThingsPanel(data, looks, select);
  const details = new Details(data, looks, scene.measure, () => repeated.again(), signal);
  const compare = new Compare(data, select, signal);
  const removed = new RemovedPanel(data, () => repeated.again(), signal);
  const earlier = new EarlierMaps(data, () => repeated.again(), signal);
  const downloads = new Downloads(data);
  const layers = new LayersPanel(data, looks);
  const coverage = new CoveragePanel(data, select);
  const legend = new Legend(data, looks, signal);
  const summary = new Summary(data, looks);
  const stage = h("section", { class: "stage", "aria-label": "Map" });
  const side = h("aside", { class: "side", "aria-label": "Clips, objects and layers" });
  const view = () => written(looks, data.hasLevels ? data.level : null, scene.framing);
  const address = new Address(id, view, side, signal);
  looks.onChange(() => address.note());
  looks.onCut(() => address.note());
  const leaveLevel = () => {
    scene.measure.end();
    looks.select(null);
    address.note();
    repeated.again();
  };
  const toolbar = new Toolbar(data, looks, scene, () => address.write(), (level) => {
    data.showLevel(level);
    draw();
    leaveLevel();
  }, signal);
  const settings = new Settings(data, { onRenamed: () => repeated.again(), onLevelDeleted: leaveLevel, onDeleted: () => leaveHome(id) });
  const upload = mayChange() ? new UploadPanel(data, () => repeated.again(), signal) : null;

  const draw = () => {
    for (const panel of [clips, things, details, downloads, layers, coverage, legend, summary, toolbar, settings]) panel.draw();
    for (const panel of [compare, removed, earlier]) void panel.draw();
    drawCrumbs(data.name);
    scene.update();
    // Another level has another camera.
    address.soon();
  };
  const repeated = follow(place, data, { clips, status, losses: new Losses(data, looks) }, draw);

  const foot = h("div", { class: "stage-foot" }, h("div", { class: "stage-notes" }, status.shown, legend.element), summary.figures);
  // In the order in which keys reach them.
  put(stage, toolbar.element, scene.element, summary.empty, foot, details.element, status.said);
  put(side,
    settings.heading, upload?.element,
    section("Clips", true, clips.element), section("Rooms and objects", true, things.element),
    mayChange() && lateSection("Removed objects", removed),
    layers.element,
    section("Coverage", false, coverage.element),
    lateSection("Changes", compare),
    mayChange() && lateSection("Earlier LiDAR maps", earlier),
    section("Downloads", false, downloads.element), mayChange() && settings.element);
  put(place.main, stage, side);
  place.main.className = "home-page";
  details.draw();
  scene.framing = framing;
  if (!framing.from && !framing.part && looks.selected) scene.show(looks.selected);
  scene.onMoved = () => address.note();
  address.scroll();
  onHomeChange(id, () => repeated.again(), signal);
}

/** Returns the function that shows the name of the home above the page; the same name changes nothing. */
function crumbsOf(place: Place): (name: string) => void {
  let shown = "";
  return (name) => {
    if (shown !== name) setCrumbs(place, [{ word: "Homes", href: toHomes() }], name);
    shown = name;
  };
}

/**
 * Shows the list in place of a deleted home, also if the page has found it gone before the deletion was answered. The person may
 * have gone to another page meanwhile.
 */
function leaveHome(id: string): void {
  const route = parse(location.hash);
  if (route.page === "home" && route.home === id) location.hash = toHomes();
}

/** Reads the home again after each of its changes, and follows its jobs. */
function follow(
  place: Place,
  data: HomeData,
  { clips, status, losses }: { clips: ClipsPanel; status: StatusLine; losses: Losses },
  draw: () => void,
): Repeated {
  const { signal } = place;
  const followed = new Followed(
    (job) => {
      const clip = data.clips.find((clip) => clip.job?.id === job.id);
      if (clip) clips.progress(clip.id, job);
    },
    () => repeated.again(),
    signal,
  );
  // One event stream follows one job; of several, all are read.
  const several = new Repeated(async () => {
    const atWork = await clipsAtWork(data.home.id, signal).catch(() => []);
    for (const { id, job } of atWork) if (job) clips.progress(id, job);
    return atWork.length > 1 ? PROGRESS_MS : null;
  }, signal);
  // Events tell when to ask; only a lost server is asked again and again.
  let isLost = false;
  const repeated = keepUpToDate(place, {
    read: () => data.refresh(signal),
    show: () => {
      for (const text of losses.told()) say(text);
      draw();
      const jobs = data.clips.filter(isUnderWay).flatMap((clip) => (clip.job ? [clip.job] : []));
      followed.follow(jobs);
      if (jobs.filter(({ state }) => state === "running").length > 1) several.again();
      // No event tells that a merge failed, or changed nothing.
      return jobs.length === 0 && data.home.map_state !== "current" ? MERGE_MS : null;
    },
    tell: (failure) => {
      if (failure) status.fail(failure);
      else if (isLost) status.show("");
      isLost = failure !== "";
    },
  });
  return repeated;
}

/** A part of the side that reads its content once it is opened. */
function lateSection(title: string, panel: { element: HTMLElement; draw: () => Promise<void> }): HTMLElement {
  const part = section(title, false, panel.element);
  part.addEventListener("toggle", () => void panel.draw());
  return part;
}
