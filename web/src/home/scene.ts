// Draws what is known of a home, as its looks say, in two or in three dimensions.

import { lidarPath } from "../api.ts";
import { rgb, type Rgb } from "../cloud/colours.ts";
import { NO_CUT_M } from "../cloud/material.ts";
import type { Cloud } from "../cloud/points.ts";
import type { Name } from "../cloud/names.ts";
import type { Point3 } from "../cloud/pick.ts";
import { CloudView } from "../cloud/view.ts";
import { h } from "../dom.ts";
import { around, type Box2, place, type Point2 } from "../frames.ts";
import { addressOf, inkOf } from "../paper.ts";
import { alarm, say, tellFailure } from "../parts/notices.ts";
import * as shapes from "../plan/shapes.ts";
import { PlanView } from "../plan/view.ts";
import { isDark, onTheme } from "../theme.ts";
import { ramped } from "../plan/raster.ts";
import type { Room, Thing } from "../types.ts";
import { named, percent } from "../words.ts";
import { filmedRooms, WANTED, wantedRooms } from "./coverage.ts";
import { Aim } from "./aim.ts";
import { boxBelow, frameOf, lidarBelow } from "./below.ts";
import type { HomeData } from "./data.ts";
import type { Looks } from "./looks.ts";
import { Measure } from "./measure.ts";
import { LevelPicture } from "./picture.ts";
import { Pointing } from "./pointing.ts";
import { HomePoints } from "./points.ts";
import { hullOfSelected, roomName, roomOf, type Selection, sureOf, thingName, thingOf } from "./selection.ts";
import type { Framing } from "./share.ts";
import { HomeSurface } from "./surface.ts";
import { TopView } from "./top.ts";

/** Margin around the LiDAR map, in metres; points outside of it are not framed. */
const AROUND_M = 1;
const MARK: Rgb = [103, 65, 217];

export class HomeScene {
  readonly element: HTMLElement;
  private readonly plan: PlanView;
  /** Null in a browser that cannot draw in three dimensions. */
  private readonly cloudView: CloudView | null;
  private readonly top: TopView;
  private readonly surface: HomeSurface;
  private readonly points: HomePoints;
  /** The cloud that the stage has. */
  private cloud: Cloud | null = null;
  private drawn = "";
  private level: string;
  private readonly picture: LevelPicture;
  readonly measure: Measure;
  /** What is loading now; empty texts for nothing. */
  private readonly loading = { points: "", surface: "" };
  /** Called after a person moved the view. */
  onMoved: () => void = () => {};

  constructor(
    private readonly data: HomeData,
    private readonly looks: Looks,
    private readonly onStatus: (text: string) => void,
    private readonly signal: AbortSignal,
  ) {
    this.plan = new PlanView("The home from above. Arrow keys move, plus and minus magnify, 0 shows all.", signal);
    this.cloudView = cloudViewOrNot(signal);
    if (!this.cloudView) looks.view = "2d";
    this.level = data.level;
    this.top = new TopView(this.plan, signal);
    this.surface = new HomeSurface(() => this.apply(), (text) => this.tell("surface", text), (error) => tellFailure(error, "The surface"), signal);
    this.points = new HomePoints({
      onShown: () => this.showPoints(),
      onGrown: () => {
        this.noteColour();
        this.cloudView?.draw();
      },
      onStatus: (text) => this.tell("points", text),
      onFailed: (text) => {
        alarm(text);
        this.drawn = "";
      },
    }, signal);
    this.element = h("div", { class: "views" }, this.cloudView?.element, this.plan.element);
    this.picture = this.pictureOf(signal);
    this.measure = new Measure(signal);
    const pointing = new Pointing(data, looks, this.measure, () => this.points.shown?.cloud ?? null, () => this.things());
    this.plan.onClick = (point) => pointing.clickInPlan(point);
    if (this.cloudView) {
      this.cloudView.onClick = (ray, reach_rad) => pointing.clickInCloud(ray, reach_rad);
      this.cloudView.surfaceOn = (ray, reach_rad, stride) => pointing.surfaceOn(ray, reach_rad, stride);
    }
    this.aimWith(pointing, signal);
    looks.onChange(() => this.apply());
    looks.onCut(() => this.cut());
    onTheme(() => this.drawPicture(), signal);
    this.update();
  }

  private tell(part: "points" | "surface", text: string): void {
    this.loading[part] = text;
    this.onStatus(this.loading.points || this.loading.surface);
  }

  /** Measures by keys also. */
  private aimWith(pointing: Pointing, signal: AbortSignal): void {
    const { cloudView, plan, looks } = this;
    const shown = () =>
      looks.view === "3d" && cloudView ? cloudView.element.querySelector("canvas") : plan.element;
    const middle = (): Point3 | null =>
      looks.view === "3d" && cloudView ? pointing.pointOn(...cloudView.middle) : [...plan.middle, 0];
    const aim = new Aim(this.element, this.measure, shown, middle, signal);
    this.measure.onChange(() => {
      this.drawRule();
      aim.draw();
    });
    plan.onShown = () => aim.note();
    plan.onMoved = () => this.onMoved();
    if (!cloudView) return;
    cloudView.onMoved = () => {
      aim.note();
      this.onMoved();
    };
  }

  get is3dThere(): boolean {
    return this.cloudView !== null;
  }

  fit(from: "corner" | "above" = "corner"): void {
    if (this.looks.view === "3d") this.cloudView?.fit(from);
    else this.plan.fit();
    this.onMoved();
  }

  /** Flies to what is selected. */
  show(selection: Selection): void {
    const points = hullOfSelected(this.data, selection);
    const box = around(points.map(([x, y]) => [x, y]));
    if (this.looks.view === "3d") this.cloudView?.fly(points);
    else if (box) this.plan.show(box);
  }

  get framing(): Framing {
    const { plan, cloudView, looks } = this;
    return looks.view === "2d" ? { from: null, part: plan.part } : { from: cloudView?.viewpoint ?? null, part: null };
  }

  set framing({ from, part }: Framing) {
    if (from && this.cloudView) this.cloudView.viewpoint = from;
    if (part) this.plan.part = part;
  }

  private drawRule(): void {
    const { ends } = this.measure;
    this.cloudView?.setRule(ends, MARK);
    this.plan.setLayer("rule", ...(ends.length > 0 ? [shapes.rule(ends.map(([x, y]) => [x, y]))] : []));
  }

  /** Draws what has changed. */
  update(): void {
    const { drawn } = this.data;
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    const { map } = this.data;
    const below = lidarBelow(this.data);
    const walls = below && boxBelow(below);
    const bounds = this.bounds();
    if (this.level !== this.data.level) {
      this.level = this.data.level;
      this.plan.fit();
      this.cloudView?.reframe();
    }
    if (bounds) this.plan.setBounds(bounds);
    const [low, high] = [map?.info.min_m, map?.info.max_m];
    if (low && high) {
      // Mirrors and windows show things far away.
      const from = low.map((at, axis) => Math.max(at, (walls?.min[axis] ?? -Infinity) - AROUND_M));
      const to = high.map((at, axis) => Math.min(at, (walls?.max[axis] ?? Infinity) + AROUND_M));
      // The rooms of a level that was just chosen come later.
      this.cloudView?.setBounds(from as Point3, to as Point3, this.outline(to[2] ?? 0), this.data.described !== "");
    } else if (bounds) this.cloudView?.setBounds([...bounds.min, 0], [...bounds.max, 1.5], this.outline(0), false);
    this.drawPicture();
    this.points.update(this.data);
    this.apply();
  }

  private showPoints(): void {
    const { shown, isComplete } = this.points;
    const cloud = shown?.cloud ?? null;
    if (cloud !== this.cloud) {
      this.cloud = cloud;
      if (shown) this.cloudView?.setCloud(shown.cloud, shown.voxel_m);
      else this.cloudView?.clear();
    }
    this.noteColour();
    this.apply();
    if (!shown) this.element.dataset.points = this.element.dataset.revision = "";
    if (!shown || !isComplete) return;
    this.element.dataset.points = String(shown.cloud.shown);
    this.element.dataset.revision = String(shown.map_revision);
  }

  /** Nothing is known of points that have not arrived. */
  private noteColour(): void {
    const { cloud } = this.points.shown ?? {};
    if (cloud && cloud.shown > 0) this.looks.noteColour(cloud.hasColour);
  }

  private bounds(): Box2 | null {
    const { map } = this.data;
    const below = lidarBelow(this.data);
    const walls = below && boxBelow(below);
    const ends = [walls?.min, walls?.max, map?.info.min_m, map?.info.max_m].filter((end) => !!end);
    return around(ends.map((end) => [end[0] ?? NaN, end[1] ?? NaN] as const));
  }

  /** The corners of all rooms, on the floor and at a height: the picture shows the home whole, filmed or not. */
  private outline(height_m: number): Point3[] {
    const corners = this.data.rooms.flatMap(({ polygon_m }) => polygon_m);
    return corners.flatMap(([x, y]): Point3[] => [[x, y, 0], [x, y, height_m]]);
  }

  private pictureOf(signal: AbortSignal): LevelPicture {
    return new LevelPicture({
      load: async (level, ink) => {
        const canvas = await inkOf(lidarPath(this.data.home.id, level, "image.png"), ink === "dark", signal);
        return { canvas, address: await addressOf(canvas) };
      },
      show: (picture) => {
        this.element.dataset.ink = picture?.ink ?? "";
        this.plan.setPicture(picture?.address ?? null, picture?.frame ?? null, picture?.at);
        this.cloudView?.setFloor(picture);
      },
      onFailed: (error) => {
        tellFailure(error, "The LiDAR map's picture");
        this.drawn = "";
      },
      revoke: (address) => URL.revokeObjectURL(address),
    }, signal);
  }

  private drawPicture(): void {
    this.picture.update(this.data.level, lidarBelow(this.data), isDark() ? "dark" : "light", frameOf(this.data));
  }

  private apply(): void {
    const { looks, data } = this;
    const is3d = looks.view === "3d";
    if (this.cloudView) this.cloudView.element.hidden = !is3d;
    this.plan.element.style.display = is3d ? "none" : "";
    this.element.dataset.colouring = looks.colouring;
    this.element.dataset.level = data.level;
    this.element.dataset.view = looks.view;
    if (looks.layers.has("paths")) this.readWays();
    if (is3d && this.cloudView) this.applyTo3d(this.cloudView);
    else this.applyTo2d();
    this.top.draw(this.points.shown, data, looks);
    this.measure.isReady = !is3d || !looks.layers.has("points") || this.points.isComplete;
  }

  /** Cuts what is drawn already. The stage draws once for all calls before its next frame. */
  private cut(): void {
    const { looks, data } = this;
    this.cloudView?.setCut(looks.cut_m ?? NO_CUT_M);
    this.top.draw(this.points.shown, data, looks);
  }

  private readWays(): void {
    this.data.readScans(this.signal, () => this.apply()).catch((error: unknown) => {
      if (!this.signal.aborted) tellFailure(error, "The camera paths");
    });
  }

  private ways() {
    const { looks, data } = this;
    const clips = looks.layers.has("paths") ? data.clips.filter((clip) => !looks.hiddenClips.has(clip.id)) : [];
    return clips.map((clip) => ({ clip, places_m: data.pathOf(clip), colour: data.colourOf(clip.id) }));
  }

  private things() {
    const { looks, data } = this;
    if (!looks.layers.has("objects")) return [];
    const footprint = ({ size_m: [length, width] }: Thing) => length * width;
    // Names of large objects go before those of small ones.
    return data.things.filter((thing) => !looks.hiddenClasses.has(thing.class)).sort((a, b) => footprint(b) - footprint(a));
  }

  /** Of the fused map's rooms, or of the robot's before there are any. */
  private roomNames(): { text: string; at_m: Point2 }[] {
    const { looks, data } = this;
    const wanted = this.wantedRooms();
    if (!looks.layers.has("rooms") && wanted.length === 0) return [];
    // The names of wanted rooms go before those of others.
    const others = looks.layers.has("rooms") ? data.rooms.filter((room) => !wanted.includes(room)) : [];
    const rooms = [...wanted, ...others];
    const shares = new Map(looks.layers.has("coverage") ? filmedRooms(data).map(({ room, walls }) => [room, walls]) : []);
    const note = (room: Room) => {
      const share = shares.get(room);
      return room === wanted[0] ? " · film here next" : share === undefined ? "" : ` · ${percent(share)} filmed`;
    };
    if (rooms.length > 0) return rooms.map((room) => ({ text: named(roomName(room)) + note(room), at_m: room.label_at_m }));
    const below = lidarBelow(data);
    return below ? below.lidar.info.rooms.map((room) => ({ text: roomName(room), at_m: place(below.at, room.centre_m) })) : [];
  }

  /** The rooms that are worth filming next, if they shall be shown. */
  private wantedRooms(): Room[] {
    return this.looks.layers.has("coverage") ? wantedRooms(this.data) : [];
  }

  private colourOf(name: string): Rgb {
    return rgb(this.data.classNamed(name)?.color ?? "");
  }

  private applyTo3d(cloudView: CloudView): void {
    const { looks, data } = this;
    this.surface.update(data, looks);
    cloudView.setSurface(this.surface.shown);
    cloudView.setColouring(looks.colouring);
    cloudView.setCut(looks.cut_m ?? NO_CUT_M);
    for (const { id, name, color } of data.classes) cloudView.setClass(id, color, !looks.hiddenClasses.has(name));
    const { shown } = this.points;
    (shown?.clips ?? []).forEach((clip, i) =>
      cloudView.setClip(i, data.colourOf(clip), !shown?.cloud.hasClips || !looks.hiddenClips.has(clip)));
    cloudView.setSurfaceClasses(data.classes.map(({ name, color }) =>
      ({ name, color, isShown: !looks.hiddenClasses.has(name) })));
    // Until the surface is there, the points stay.
    const surface = looks.isSurface && this.surface.shown !== null;
    this.element.dataset.surface = surface ? String(this.surface.shown?.triangles) : "";
    cloudView.show({ points: looks.layers.has("points") && !surface, surface, floor: looks.layers.has("lidar") });
    cloudView.setPaths(this.ways().filter(({ places_m }) => places_m.length > 1));
    const things = this.things();
    cloudView.setThings(things, (thing) => this.colourOf(thing.class));
    cloudView.setNames([
      ...this.roomNames().map(({ text, at_m: [x, y] }): Name => ({ text, kind: "room", at_m: [x, y, 0] })),
      ...things.map((thing): Name => {
        const [[x, y, z], half] = [thing.centre_m, thing.size_m[2] / 2];
        return { text: thingName(thing), kind: "object", at_m: [x, y, z + half], low_m: z - half };
      }),
    ]);
    cloudView.setSelected(thingOf(data, looks.selected), roomOf(data, looks.selected)?.polygon_m ?? null, MARK);
    cloudView.setWanted(this.wantedRooms().map(({ polygon_m }) => polygon_m), WANTED);
  }

  private applyTo2d(): void {
    const { looks, data, plan } = this;
    plan.showPicture(looks.layers.has("lidar"));
    const rooms = looks.layers.has("rooms") ? data.rooms : [];
    plan.setLayer("rooms", ...rooms.map((room) => shapes.room(room)));
    const [filmed, wanted] = [looks.layers.has("coverage") ? filmedRooms(data) : [], this.wantedRooms()];
    const others = filmed.filter(({ room }) => room !== wanted[0]);
    plan.setLayer("coverage", ...others.map(({ room, walls }) => shapes.room(room, "room filmed", ramped(walls))));
    plan.setLayer("wanted", ...wanted.map((room, i) => shapes.room(room, i === 0 ? "room wanted next" : "room wanted")));
    const things = this.things();
    const shapeOf = (thing: Thing, colour: Rgb) => shapes.thing(thing, colour, `${thingName(thing)}, ${sureOf(thing)}`);
    plan.setLayer("things", ...things.map((thing) => shapeOf(thing, this.colourOf(thing.class))));
    const [thing, room] = [thingOf(data, looks.selected), roomOf(data, looks.selected)];
    plan.setLayer("selected",
      ...(thing ? [shapeOf(thing, MARK)] : []),
      ...(room ? [shapes.room(room, "room selected")] : []));
    plan.setLayer("paths", ...this.ways().flatMap(({ clip, places_m, colour }) => {
      const pose = data.poseOf(clip);
      const way = places_m.length > 1 ? [shapes.line(places_m.map(([x, y]) => [x, y]), colour)] : [];
      const name = data.nameOf(clip);
      return pose ? [...way, shapes.wedge(pose, colour, name)] : way;
    }));
    plan.setNames([
      ...this.roomNames().map(({ text, at_m }) => ({ text, at_m, kind: "room-name" })),
      ...things.map((thing) => ({
        text: thingName(thing), at_m: [thing.centre_m[0], thing.centre_m[1]] as Point2, kind: "thing-name",
      })),
    ]);
  }
}

function cloudViewOrNot(signal: AbortSignal): CloudView | null {
  try {
    return new CloudView(
      "The home in three dimensions. Arrow keys turn, W A S D walk, plus and minus go nearer and away.", signal);
  } catch {
    say("This browser does not support WebGL: the home is shown from above only.");
    return null;
  }
}
