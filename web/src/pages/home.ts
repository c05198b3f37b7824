// One home: its map, its clips, and what is put into it.

import { deleteHome, Refusal } from "../api.ts";
import { h, put } from "../dom.ts";
import { ClipsPanel } from "../home/clips.ts";
import { Compare } from "../home/compare.ts";
import { HomeData } from "../home/data.ts";
import { CoveragePanel } from "../home/coverage.ts";
import { Details } from "../home/details.ts";
import { Downloads } from "../home/downloads.ts";
import { LayersPanel, section } from "../home/layers.ts";
import { Legend } from "../home/legend.ts";
import { Looks } from "../home/looks.ts";
import { HomeScene } from "../home/scene.ts";
import type { Selection } from "../home/selection.ts";
import { read } from "../home/share.ts";
import { ThingsPanel } from "../home/things.ts";
import { Toolbar } from "../home/toolbar.ts";
import { confirm } from "../parts/dialog.ts";
import { Followed, onHomeChange, Repeated } from "../parts/live.ts";
import { attempt, say } from "../parts/notices.ts";
import { toHomes } from "../route.ts";
import { UploadPanel } from "../upload/panel.ts";
import { count, isUnderWay, many, percent } from "../words.ts";
import { type Place, setCrumbs } from "./page.ts";

const RETRY_MS = 1500;

export async function showHome(place: Place, id: string, view: URLSearchParams): Promise<void> {
  setCrumbs(place, [{ word: "Homes", href: toHomes() }], id);
  const { signal } = place;
  const data = await HomeData.load(id, view.get("level"), signal);
  if (signal.aborted) return;
  setCrumbs(place, [{ word: "Homes", href: toHomes() }], data.home.name || id);
  const looks = new Looks();
  const viewpoint = read(view, looks);
  if (!data.map?.info.points && !view.has("view")) looks.view = "2d";
  const status = h("p", { class: "stage-status", role: "status" });
  const facts = h("p", { class: "stage-facts" });
  const empty = h("div", { class: "stage-empty" });
  const scene = new HomeScene(data, looks, (text) => (status.textContent = text), signal);
  const select = (selection: Selection) => {
    looks.select(selection);
    scene.show(selection);
  };
  const clips = new ClipsPanel(data, looks, () => repeated.again());
  const things = new ThingsPanel(data, looks, select);
  const details = new Details(data, looks, scene.measure, () => repeated.again());
  const compare = new Compare(data, select, signal);
  const downloads = new Downloads(data);
  const layers = new LayersPanel(data, looks);
  const coverage = new CoveragePanel(data, select);
  const legend = new Legend(data, looks);
  const toolbar = new Toolbar(data, looks, scene, (level) => {
    data.level = level;
    looks.select(null);
    repeated.again();
  });
  const upload = new UploadPanel(id, () => data.level, () => repeated.again(), signal);

  const describe = () => {
    const { map, lidar } = data;
    const seen = data.coverage ? ` · explains ${percent(data.coverage.seen)} of the LiDAR map` : "";
    facts.textContent = map
      ? `Map ${map.revision} · ${count(map.info.points)} points · ${many(map.clips.length, "clip")}${seen}`
      : "";
    put(empty, ...(map?.info.points ? [] : emptyStage(data)));
    empty.hidden = !!map?.info.points || (looks.view === "2d" && lidar !== null && data.clips.length > 0);
  };
  looks.onChange(describe);
  const followed = new Followed(
    (job) => {
      const clip = data.clips.find((clip) => clip.job?.id === job.id);
      if (clip?.state === "queued" && job.state === "running") repeated.again();
      if (clip) clips.progress(clip.id, job);
    },
    () => repeated.again(),
    signal,
  );
  const changes = section("Changes", false, compare.element);
  changes.addEventListener("toggle", () => void compare.draw());
  // Events tell when to ask; only a lost server is asked again and again.
  const repeated = new Repeated(async () => {
    try {
      await data.refresh(signal);
      if (signal.aborted) return null;
      status.classList.remove("bad");
      if (status.dataset.lost) delete status.dataset.lost, (status.textContent = "");
      for (const panel of [clips, things, details, downloads, layers, coverage, legend, toolbar]) panel.draw();
      void compare.draw();
      scene.update();
      describe();
    } catch (error) {
      if (signal.aborted) return null;
      if (error instanceof Refusal && error.isFinal) return place.again(), null;
      status.classList.add("bad");
      status.dataset.lost = "yes";
      status.textContent = error instanceof Error ? error.message : String(error);
      return RETRY_MS;
    }
    const jobs = data.clips.filter(isUnderWay).flatMap((clip) => (clip.job ? [clip.job] : []));
    followed.follow(jobs.sort((a, b) => Number(b.state === "running") - Number(a.state === "running")));
    return null;
  }, signal);

  const remove = h("button", { type: "button", class: "danger quiet" }, "Delete home");
  remove.addEventListener("click", () => void removeHome(data, remove));
  put(place.main,
    h("section", { class: "stage", "aria-label": "Map" },
      scene.element, empty, toolbar.element, details.element,
      h("div", { class: "stage-foot" }, legend.element, facts), status),
    h("aside", { class: "side", "aria-label": "Clips, objects and layers" },
      h("h1", {}, data.home.name || id),
      upload.element,
      section("Clips", true, clips.element),
      section("Rooms and objects", true, things.element),
      layers.element,
      section("Coverage", false, coverage.element),
      changes,
      section("Downloads", false, downloads.element),
      h("p", { class: "row end" }, remove)));
  place.main.className = "home-page";
  describe();
  details.draw();
  scene.viewpoint = viewpoint;
  if (!viewpoint && looks.selected) scene.show(looks.selected);
  onHomeChange(id, () => repeated.again(), signal);
}

function emptyStage({ lidar, clips, map, level }: HomeData): HTMLElement[] {
  if (clips.some(isUnderWay)) {
    return said("The clips are being aligned", "The map appears here as soon as the first clip has found its place.");
  }
  if (map && clips.length === 0) return said("No clips yet", "Film the home and drop the clips on this page.");
  if (map) return said(`No clip of the level ${level}`, "Film on this level and drop the clips on this page.");
  if (!lidar) {
    return said(clips.length === 0 ? "This home is empty" : "No fused map yet",
      "Drop the LiDAR map of the robot vacuum on this page: Valetudo JSON, a zip of a ROS map, CSV or PLY points.");
  }
  return said("No fused map yet", clips.length === 0
    ? "Drop clips on this page: zips of RGB-D recordings."
    : "No clip has a certain place. Open a clip to see why, or to choose its place yourself.");
}

function said(title: string, advice: string): HTMLElement[] {
  return [h("h2", {}, title), h("p", {}, advice)];
}

async function removeHome(data: HomeData, button: HTMLButtonElement): Promise<void> {
  const { home, clips } = data;
  const text = `The LiDAR map, ${many(clips.length, "clip")} and everything made of them are removed for good.`;
  if (!(await confirm(`Delete ${home.name || home.id}?`, text, "Delete home"))) return;
  await attempt(button, async () => {
    await deleteHome(home.id);
    say(`${home.name || home.id} is deleted.`);
    location.hash = toHomes();
  });
}
