// The fused points on the plan, drawn a moment after something changed.

import { rgb } from "../cloud/colours.ts";
import { addressOf } from "../paper.ts";
import { frameOf, fromAbove, type Shown } from "../plan/raster.ts";
import { tellFailure } from "../parts/notices.ts";
import type { PlanView } from "../plan/view.ts";
import type { HomeData } from "./data.ts";
import type { Looks } from "./looks.ts";
import type { HomeCloud } from "./points.ts";

export class TopView {
  private timer = 0;
  private drawn = "";
  private address: string | null = null;

  constructor(
    private readonly plan: PlanView,
    private readonly signal: AbortSignal,
  ) {
    signal.addEventListener("abort", () => {
      clearTimeout(this.timer);
      this.replace(null);
    });
  }

  draw(points: HomeCloud | null, data: HomeData, looks: Looks): void {
    if (looks.view !== "2d") return;
    const [min, max] = [data.map?.info.min_m, data.map?.info.max_m];
    if (!points || !min || !max || !looks.layers.has("points")) {
      this.drawn = "";
      this.plan.setPoints(null, null);
      return;
    }
    const { cloud, revision, voxel_m } = points;
    const drawn = JSON.stringify([
      revision, cloud.shown, looks.colouring, looks.cut_m, [...looks.hiddenClasses], [...looks.hiddenClips],
    ]);
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    const frame = frameOf({ min: [min[0], min[1]], max: [max[0], max[1]] }, voxel_m);
    const shown = shownOf(points, data, looks);
    clearTimeout(this.timer);
    this.timer = window.setTimeout(() => {
      const canvas = document.createElement("canvas");
      [canvas.width, canvas.height] = [frame.width_px, frame.height_px];
      const pixels = fromAbove(cloud.raw, cloud.shown, frame, shown);
      canvas.getContext("2d")?.putImageData(new ImageData(pixels, frame.width_px, frame.height_px), 0, 0);
      void addressOf(canvas).then((address) => {
        if (this.signal.aborted || this.drawn !== drawn) return URL.revokeObjectURL(address);
        this.plan.setPoints(address, frame);
        this.replace(address);
      }, (error: unknown) => {
        if (this.drawn !== drawn) return;
        // The next change draws again.
        this.drawn = "";
        tellFailure(error, "The points from above");
      });
    }, 30);
  }

  private replace(address: string | null): void {
    if (this.address) URL.revokeObjectURL(this.address);
    this.address = address;
  }
}

function shownOf({ cloud, clips }: HomeCloud, data: HomeData, looks: Looks): Shown {
  const classes = data.classes.filter(({ name }) => !looks.hiddenClasses.has(name));
  const shown = clips.map((clip, i) => ({ clip, i })).filter(({ clip }) => !cloud.hasClips || !looks.hiddenClips.has(clip));
  return {
    colouring: looks.colouring,
    cut_m: looks.cut_m ?? Infinity,
    classes: new Map(classes.map(({ id, color }) => [id, rgb(color)])),
    clips: new Map(shown.map(({ clip, i }) => [i, data.colourOf(clip)])),
  };
}
