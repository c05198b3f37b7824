// The picture of the shown level's LiDAR map. That of another level goes at once: it would lie under the wrong rooms.

import type { LidarMap, PictureFrame, Pose2 } from "../types.ts";
import { pause, retryDelay_ms } from "../upload/retry.ts";

export type Ink = "light" | "dark";

/** A picture, its address for an SVG, and its place. */
export interface Picture {
  canvas: HTMLCanvasElement;
  address: string;
  frame: PictureFrame;
  /** The pose of the LiDAR map's frame in that of the home's map. */
  at: Pose2;
  /** Of the LiDAR map. */
  revision: number;
  ink: Ink;
}

interface Wanted {
  lidar: Pick<LidarMap, "revision" | "image">;
  at: Pose2;
}

interface Listener {
  /** Loads the picture of a level. */
  load: (level: string, ink: Ink) => Promise<Pick<Picture, "canvas" | "address">>;
  /** Shows a picture, or none. */
  show: (picture: Picture | null) => void;
  onFailed: (error: unknown) => void;
  /** Gives an address back. */
  revoke: (address: string) => void;
}

export class LevelPicture {
  private level = "";
  /** The level, the revision and the ink of the picture that is shown or on its way. */
  private wanted = "";
  private shown: Picture | null = null;

  constructor(
    private readonly listener: Listener,
    private readonly signal: AbortSignal,
  ) {
    signal.addEventListener("abort", () => this.replace(null));
  }

  /**
   * Shows the picture of a level's LiDAR map. A newer picture of one level replaces the earlier one late. Without a map, the picture
   * of the revision `kept` stays: the home's map is in its frame, and the service has no picture of it any more.
   */
  update(level: string, below: Wanted | null, ink: Ink, kept: number | null = null): void {
    const { x_m, y_m, yaw_rad } = below?.at ?? { x_m: 0, y_m: 0, yaw_rad: 0 };
    const wanted = below ? [level, below.lidar.revision, ink, x_m, y_m, yaw_rad].join(" ") : "";
    const stays = kept !== null && this.shown?.revision === kept && this.shown.ink === ink;
    if (this.level !== level || (!below && !stays)) this.clear();
    this.level = level;
    if (wanted === this.wanted) return;
    this.wanted = wanted;
    if (below) void this.load(wanted, level, below, ink);
  }

  private async load(wanted: string, level: string, { lidar: { image, revision }, at }: Wanted, ink: Ink): Promise<void> {
    const isOld = () => this.signal.aborted || wanted !== this.wanted;
    for (let failures = 1; !isOld(); failures++) {
      try {
        const loaded = await this.listener.load(level, ink);
        if (isOld()) return this.listener.revoke(loaded.address);
        const picture = { ...loaded, frame: image, at, revision, ink };
        this.listener.show(picture);
        return this.replace(picture);
      } catch (error) {
        if (isOld()) return;
        const wait_ms = retryDelay_ms(error, failures);
        if (wait_ms === null) {
          // The next update tries again.
          this.wanted = "";
          return this.listener.onFailed(error);
        }
        await pause(wait_ms, this.signal);
      }
    }
  }

  private clear(): void {
    this.wanted = "";
    if (!this.shown) return;
    this.listener.show(null);
    this.replace(null);
  }

  private replace(picture: Picture | null): void {
    if (this.shown) this.listener.revoke(this.shown.address);
    this.shown = picture;
  }
}
