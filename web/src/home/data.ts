// All that the page of a home knows.

import * as api from "../api.ts";
import { clipColour, type Rgb } from "../cloud/colours.ts";
import { place } from "../frames.ts";
import type { Class, Clip, Coverage, Home, HomeMap, LidarMap, Pose2, Room, Scan, Thing } from "../types.ts";

/** The level that the viewer shows: the only one of a home with one LiDAR map. */
const SHOWN = "main";

export class HomeData {
  lidar: LidarMap | null = null;
  clips: Clip[] = [];
  map: HomeMap | null = null;
  rooms: Room[] = [];
  things: Thing[] = [];
  coverage: Coverage | null = null;
  /** By clip; null where the service has none. */
  readonly scans = new Map<string, Scan | null>();

  private constructor(
    public home: Home,
    readonly classes: Class[],
  ) {}

  static async load(id: string, signal: AbortSignal): Promise<HomeData> {
    const [home, classes] = await Promise.all([api.home(id, signal), api.classes()]);
    const data = new HomeData(home, classes);
    await data.refresh(signal);
    return data;
  }

  /** Asks for everything that changes. */
  async refresh(signal: AbortSignal): Promise<void> {
    const { id } = this.home;
    const before = this.map;
    [this.home, this.lidar, this.clips, this.map] = await Promise.all([
      api.home(id, signal), api.lidarMap(id, signal), api.clips(id, signal), api.homeMap(id, signal),
    ]);
    const shown = this.map?.levels.find(({ level }) => level === SHOWN);
    if (this.map && shown) this.map.info = shown.info;
    if (this.map && this.map.revision !== before?.revision) {
      [this.rooms, this.things, this.coverage] = await Promise.all([
        api.rooms(id, signal), api.things(id, signal), api.coverage(id, signal),
      ]);
      this.rooms = this.rooms.filter(({ level }) => level === SHOWN);
      this.things = this.things.filter(({ level }) => level === SHOWN);
    } else if (!this.map) {
      [this.rooms, this.things, this.coverage] = [[], [], null];
    }
    await this.readScans(signal);
  }

  /** The ways of the cameras do not change, so each is asked for once. */
  private async readScans(signal: AbortSignal): Promise<void> {
    const wanted = this.clips.filter((clip) => clip.alignment && !this.scans.has(clip.id));
    // One at a time, and no more once the service has shown that it has none.
    for (const clip of wanted) {
      const scan = await api.scan(this.home.id, clip.id, signal);
      this.scans.set(clip.id, scan);
      if (!scan) break;
    }
  }

  /** The place of a clip among all of its home, from 0. */
  indexOf(clip: string): number {
    return this.clips.findIndex((other) => other.id === clip);
  }

  colourOf(clip: string): Rgb {
    return clipColour(Math.max(0, this.indexOf(clip)));
  }

  /** Where a clip is: in the newest map, or by its own answer; null on a level that is not shown. */
  poseOf(clip: Clip): Pose2 | null {
    const own = clip.state === "aligned" ? clip.alignment : null;
    const at = this.map?.clips.find((other) => other.clip === clip.id) ?? clip.choice ?? own;
    return at?.level === SHOWN ? at.map_from_clip : null;
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

  /** What changes what is drawn; the same text means the same picture. */
  get drawn(): string {
    const poses = this.clips.map((clip) => [clip.id, this.poseOf(clip), this.scans.has(clip.id)]);
    return JSON.stringify([this.map?.revision, this.map?.created_at, this.lidar?.revision, poses]);
  }
}
