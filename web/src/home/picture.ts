// The picture of the shown level's LiDAR map. That of another level goes at once: it would lie under the wrong rooms.

import type { LidarMap, PictureFrame } from "../types.ts";

export type Ink = "light" | "dark";

/** A picture, its address for an SVG, and its place. */
export interface Picture {
  canvas: HTMLCanvasElement;
  address: string;
  frame: PictureFrame;
  ink: Ink;
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

  /** Shows the picture of a level's LiDAR map; null if it has none. A newer picture of one level replaces the earlier one late. */
  update(level: string, lidar: Pick<LidarMap, "revision" | "image"> | null, ink: Ink): void {
    const wanted = lidar ? `${level} ${lidar.revision} ${ink}` : "";
    if (this.level !== level || !lidar) this.clear();
    this.level = level;
    if (!lidar || wanted === this.wanted) return;
    this.wanted = wanted;
    void this.load(wanted, level, lidar.image, ink);
  }

  private async load(wanted: string, level: string, frame: PictureFrame, ink: Ink): Promise<void> {
    const isOld = () => this.signal.aborted || wanted !== this.wanted;
    try {
      const loaded = await this.listener.load(level, ink);
      if (isOld()) return this.listener.revoke(loaded.address);
      const picture = { ...loaded, frame, ink };
      this.listener.show(picture);
      this.replace(picture);
    } catch (error) {
      if (isOld()) return;
      // The next update tries again.
      this.wanted = "";
      this.listener.onFailed(error);
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
