// Loads the points of a home, and again when the map has other points. The earlier points stay until the new ones are
// complete.

import { homePath } from "../api.ts";
import { type Cloud, load } from "../cloud/points.ts";
import { isSessionEnd, reportSessionEnd } from "../session.ts";
import { pause, retryDelay_ms } from "../upload/retry.ts";
import { percent } from "../words.ts";
import type { HomeData } from "./data.ts";

/** Time between redraws while points arrive. */
const REDRAW_MS = 250;

/** A cloud, and the map that it was read of. */
export interface HomeCloud {
  cloud: Cloud;
  /** The first revision that was read with these points, and its level. */
  revision: string;
  /** The newest revision with these points. */
  map_revision: number;
  voxel_m: number;
  /** The ids of the clips; the points have indices of this list. */
  clips: string[];
}

interface Listener {
  /** Called when another cloud is shown, and when the shown one is complete. */
  onShown: () => void;
  /** Called when the shown cloud has grown. */
  onGrown: () => void;
  onStatus: (text: string) => void;
  onFailed: (text: string) => void;
}

export class HomePoints {
  /** The shown points; null without any. */
  shown: HomeCloud | null = null;
  /** The revision and the level of the points that are shown or being loaded. */
  private wanted = "";
  private level = "";
  private isLoading = false;
  /** Attempts in a row that failed. */
  private failures = 0;
  private loading = new AbortController();

  constructor(
    private readonly listener: Listener,
    signal: AbortSignal,
  ) {
    signal.addEventListener("abort", () => this.loading.abort());
  }

  /** False while points are missing. */
  get isComplete(): boolean {
    return this.shown ? isWhole(this.shown.cloud) : !this.isLoading;
  }

  /** Begins to load the points of another map. */
  update(data: HomeData): void {
    const { map, level } = data;
    if (this.level !== level) this.show(null);
    this.level = level;
    const wanted = map && map.info.points > 0 ? `${map.revision} ${map.created_at} ${level}` : "";
    if (wanted === this.wanted) return;
    this.wanted = wanted;
    this.loading.abort();
    this.loading = new AbortController();
    this.isLoading = wanted !== "";
    this.failures = 0;
    if (this.isLoading) return this.load(data, wanted, this.loading.signal);
    this.show(null);
    this.listener.onStatus("");
  }

  private load(data: HomeData, revision: string, signal: AbortSignal): void {
    const { map, home, level } = data;
    if (!map) return;
    const of = { revision, map_revision: map.revision, voxel_m: map.info.voxel_m, clips: map.clips.map(({ clip }) => clip) };
    const { onGrown, onStatus, onFailed } = this.listener;
    const known = this.shown && isWhole(this.shown.cloud) ? this.shown.cloud.tag : null;
    let drawn_ms = 0;
    const grown = (cloud: Cloud) => {
      onStatus(isWhole(cloud) ? "" : `Points ${percent(cloud.shown / cloud.count)}`);
      if (this.shown?.cloud !== cloud) return;
      // Each picture starts again, so not every piece makes one.
      if (!isWhole(cloud) && performance.now() - drawn_ms < REDRAW_MS) return;
      drawn_ms = performance.now();
      onGrown();
    };
    load(homePath(home.id, "map", `points?format=ply&level=${encodeURIComponent(level)}`), {
      begun: (cloud) => {
        // A complete cloud of the earlier map stays: a measurement goes through missing points.
        if (!this.shown || !isWhole(this.shown.cloud)) this.show({ ...of, cloud });
        grown(cloud);
      },
      grown,
      ended: (cloud) => {
        this.isLoading = false;
        this.show({ ...of, cloud });
        grown(cloud);
      },
      same: () => {
        this.isLoading = false;
        onStatus("");
        if (this.shown) this.show({ ...this.shown, map_revision: map.revision });
      },
      nothing: () => {
        this.isLoading = false;
        onStatus("");
      },
      failed: (error) => {
        const wait_ms = retryDelay_ms(error, ++this.failures);
        if (wait_ms !== null) {
          onStatus(`The points are requested again: ${error.message}`);
          void pause(wait_ms, signal).then(() => signal.aborted || this.load(data, revision, signal));
          return;
        }
        this.isLoading = false;
        onStatus("");
        // The next change of the home tries again.
        this.wanted = "";
        if (!this.isComplete) this.show(null);
        if (isSessionEnd(error)) reportSessionEnd(error.message);
        else onFailed(`The points: ${error.message}`);
      },
    }, signal, known);
  }

  private show(shown: HomeCloud | null): void {
    if (!shown && !this.shown) return;
    this.shown = shown;
    this.listener.onShown();
  }
}

function isWhole({ shown, count }: Cloud): boolean {
  return shown >= count;
}
