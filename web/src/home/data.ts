// All that the page of a home knows.

import * as api from "../api.ts";
import { clipColour, type Rgb } from "../cloud/colours.ts";
import { composed, place } from "../frames.ts";
import type { Class, Clip, Coverage, Home, HomeMap, LidarMap, Pose2, RobotRoom, Room, Scan, Thing } from "../types.ts";
import { patiently } from "../upload/retry.ts";
import { clipName } from "../words.ts";
import { lidarBelow } from "./below.ts";

/** The level that is shown first, as in the service. */
const MAIN = "main";
/** Scans that are asked for at a time. */
const SCANS_AT_ONCE = 4;

export class HomeData {
  /** The LiDAR maps of all levels, by the levels' names. */
  lidars: LidarMap[] = [];
  /** The LiDAR map of the level that is shown. */
  lidar: LidarMap | null = null;
  /** The level that is shown. */
  level = MAIN;
  clips: Clip[] = [];
  map: HomeMap | null = null;
  rooms: Room[] = [];
  things: Thing[] = [];
  coverage: Coverage | null = null;
  /** By clip; null where the service has none. */
  readonly scans = new Map<string, Scan | null>();

  /** The map and the level that the rooms, the objects and the coverage were read of. */
  described = "";
  /** Objects that a person removed here, by id: the newest map may still have them. */
  private readonly removed = new Map<string, Thing>();
  /** The number of objects that were removed or brought back here. */
  removals = 0;
  /** The ids of the clips and the levels that are deleted here: their events may come before the answers. */
  readonly deletedHere = new Set<string>();
  private isReading = false;

  private constructor(
    public home: Home,
    readonly classes: Class[],
  ) {}

  static async load(id: string, level: string | null, signal: AbortSignal): Promise<HomeData> {
    const [home, classes] = await Promise.all([api.home(id, signal), api.classes()]);
    const data = new HomeData(home, classes);
    data.level = level ?? MAIN;
    await data.refresh(signal);
    return data;
  }

  /** The name of the home for people. */
  get name(): string {
    return this.home.name || this.home.id;
  }

  /** The names of the levels; a home with one storey has one. */
  get levels(): string[] {
    return this.lidars.map(({ level }) => level);
  }

  get hasLevels(): boolean {
    return this.lidars.length > 1;
  }

  /** The rooms of the robot's map while the map of the clips does not have the shown level. */
  get robotRooms(): RobotRoom[] {
    const { map, lidar, level } = this;
    if (!lidar || map?.levels.some((one) => one.level === level)) return [];
    // A room has the same id in the map of the clips, so it stays selected.
    const prefix = level === MAIN ? "" : `${level}~`;
    return lidar.info.rooms.map((room) => ({ ...room, id: prefix + room.id }));
  }

  /** Asks for everything that changes. */
  async refresh(signal: AbortSignal): Promise<void> {
    const { id } = this.home;
    [this.home, this.lidars, this.clips, this.map] = await Promise.all([
      api.home(id, signal), api.lidarMaps(id, signal), api.clips(id, signal), api.homeMap(id, signal),
    ]);
    const { levels } = this;
    if (!levels.includes(this.level)) this.level = levels.includes(MAIN) ? MAIN : (levels[0] ?? MAIN);
    this.takeLevel();
    await this.describe(signal);
    await this.readRemoved(signal);
  }

  /** Shows another level. Its LiDAR map is there at once; its rooms and objects come with the next `refresh`. */
  showLevel(level: string): void {
    if (level === this.level) return;
    this.level = level;
    this.takeLevel();
    [this.rooms, this.things, this.coverage, this.described] = [[], [], null, ""];
  }

  /** Takes the LiDAR map and the figures of the shown level. */
  private takeLevel(): void {
    const { map, level } = this;
    this.lidar = this.lidars.find((one) => one.level === level) ?? null;
    const shown = map?.levels.find((one) => one.level === level);
    if (map) map.info = shown?.info ?? { ...map.info, points: 0, classes: [], min_m: null, max_m: null };
  }

  /** Reads what the map has on the shown level, unless it is known. */
  private async describe(signal: AbortSignal): Promise<void> {
    const { map, level, home: { id } } = this;
    const isThere = map?.levels.some((one) => one.level === level);
    const described = map && isThere ? `${map.revision} ${map.created_at} ${level}` : "";
    if (described === this.described) return;
    if (described) {
      const [rooms, things, coverage] = await Promise.all([
        api.rooms(id, signal), api.things(id, signal), api.coverage(id, level, signal),
      ]);
      // Another level was chosen meanwhile; its own reading follows.
      if (level !== this.level) return;
      for (const gone of this.removed.keys()) if (!things.some((thing) => thing.id === gone)) this.removed.delete(gone);
      this.rooms = rooms.filter((room) => room.level === level);
      this.things = things.filter((thing) => thing.level === level && !this.removed.has(thing.id));
      this.coverage = coverage;
    } else {
      [this.rooms, this.things, this.coverage] = [[], [], null];
    }
    this.described = described;
  }

  /** Puts the objects back that were removed here and brought back elsewhere. */
  private async readRemoved(signal: AbortSignal): Promise<void> {
    if (this.removed.size === 0) return;
    const { removals } = this;
    const { objects } = await api.corrections(this.home.id, signal);
    // A person changed something meanwhile; the next reading follows.
    if (removals !== this.removals) return;
    const hidden = new Set(objects.filter((object) => object.hidden).map(({ id }) => id));
    for (const id of [...this.removed.keys()]) if (!hidden.has(id)) this.bringBack(id);
  }

  /** Runs the deletion of a clip or a level. */
  async deleting(id: string, act: () => Promise<void>): Promise<void> {
    this.deletedHere.add(id);
    try {
      await act();
    } catch (error) {
      this.deletedHere.delete(id);
      throw error;
    }
  }

  /** Takes an object out of the lists at once: the map without it comes later. */
  remove(thing: Thing): void {
    this.removals++;
    this.removed.set(thing.id, thing);
    this.things = this.things.filter(({ id }) => id !== thing.id);
  }

  /** Puts an object back that was removed; null for one that was removed elsewhere, which comes with the next map. */
  bringBack(id: string, thing = this.removed.get(id) ?? null): void {
    this.removals++;
    this.removed.delete(id);
    if (thing?.level === this.level && !this.things.some((other) => other.id === id)) this.things = [...this.things, thing];
  }

  /** Reads the ways of the cameras that are not known; `onRead` is called after some. They do not change. */
  async readScans(signal: AbortSignal, onRead: () => void): Promise<void> {
    if (this.isReading) return;
    this.isReading = true;
    try {
      for (;;) {
        const wanted = this.clips.filter((clip) => (clip.alignment || clip.last_answer) && !this.scans.has(clip.id)).slice(0, SCANS_AT_ONCE);
        if (wanted.length === 0) return;
        const scans = await Promise.all(wanted.map((clip) => patiently(() => api.scan(this.home.id, clip.id, signal), signal)));
        wanted.forEach((clip, i) => this.scans.set(clip.id, scans[i] ?? null));
        onRead();
      }
    } finally {
      this.isReading = false;
    }
  }

  /** The place of a clip among all of its home, from 0. */
  indexOf(clip: string): number {
    return this.clips.findIndex((other) => other.id === clip);
  }

  nameOf(clip: Clip): string {
    return clipName(clip, this.indexOf(clip.id) + 1);
  }

  colourOf(clip: string): Rgb {
    return clipColour(Math.max(0, this.indexOf(clip)));
  }

  /** The place of a clip in the newest map. */
  private inMap(clip: Clip) {
    return this.map?.clips.find((other) => other.clip === clip.id) ?? null;
  }

  /** The place of a clip by its choice or its own answer: in the frame of the newest LiDAR map. */
  private ownPlaceOf(clip: Clip) {
    return clip.choice ?? (clip.state === "aligned" ? clip.alignment : null);
  }

  /** The level that a clip was recorded on; null if that is not known. */
  levelOf(clip: Clip): string | null {
    return (this.inMap(clip) ?? this.ownPlaceOf(clip))?.level ?? null;
  }

  /** A clip's pose on the level that is shown; null on any other, and if its frame is not known beside that of the map. */
  poseOf(clip: Clip): Pose2 | null {
    if (this.levelOf(clip) !== this.level) return null;
    const inMap = this.inMap(clip);
    if (inMap) return inMap.map_from_clip;
    const [below, own] = [lidarBelow(this), this.ownPlaceOf(clip)?.map_from_clip];
    return below && own ? composed(below.at, own) : null;
  }

  /** A clip's cameras in the map's frame; empty where they are not known. */
  pathOf(clip: Clip): [number, number, number][] {
    const [pose, scan] = [this.poseOf(clip), this.scans.get(clip.id)];
    if (!pose || !scan) return [];
    return scan.cameras.map(({ position_m: [x, y, z] }) => [...place(pose, [x, y]), z]);
  }

  classNamed(name: string): Class | undefined {
    return this.classes.find((known) => known.name === name);
  }

  /** Key of the picture: the same text means the same picture. */
  get drawn(): string {
    const poses = this.clips.map((clip) => [clip.id, this.poseOf(clip), this.scans.has(clip.id)]);
    return JSON.stringify([this.level, this.described, this.map?.revision, this.map?.created_at, this.lidar?.revision, this.removals, poses]);
  }
}
