// Points on the graphics card, filled while they arrive.

import * as THREE from "three";
import { file, Refusal } from "../api.ts";
import { retryDelay_ms } from "../upload/retry.ts";
import type { Ask, Told } from "./messages.ts";
import { emptyPoints, type Points } from "./ply.ts";

declare const POINTS_WORKER: string;

interface Arrival {
  begun(cloud: Cloud): void;
  grown(cloud: Cloud): void;
  ended(cloud: Cloud): void;
  /** The points are those that were known. */
  same?(): void;
  /** There are no points yet. */
  nothing(): void;
  /** With a `Refusal` unless the points cannot be read. */
  failed(error: Error): void;
}

/** A cloud that knows how much of itself is there. */
export class Cloud {
  readonly geometry = new THREE.BufferGeometry();
  shown = 0;
  /** True if a point that arrived has a colour; black points have none. */
  hasColour = false;
  /** The start and the number of points of each piece that arrived; within it points are scattered. */
  private readonly pieces: { start: number; count: number }[] = [];
  private readonly points: Points;
  private readonly attributes: { attribute: THREE.BufferAttribute; of: keyof Points; width: number }[];

  constructor(
    readonly count: number,
    readonly hasClips: boolean,
    /** The `ETag` of the points. */
    readonly tag: string | null = null,
  ) {
    this.points = emptyPoints(count);
    const { position, tint, kind, normal } = this.points;
    this.attributes = [
      { attribute: new THREE.BufferAttribute(position, 3), of: "position", width: 3 },
      { attribute: new THREE.BufferAttribute(tint, 4, true), of: "tint", width: 4 },
      { attribute: new THREE.BufferAttribute(kind, 4), of: "kind", width: 4 },
      { attribute: new THREE.BufferAttribute(normal, 4, true), of: "normal", width: 4 },
    ];
    for (const { attribute, of } of this.attributes) {
      this.geometry.setAttribute(of === "normal" ? "shade" : of, attribute);
    }
  }

  add(at: number, more: Points): void {
    for (const { attribute, of, width } of this.attributes) {
      this.points[of].set(more[of], at * width);
      attribute.addUpdateRange(at * width, more[of].length);
      attribute.needsUpdate = true;
    }
    const count = more.position.length / 3;
    this.hasColour ||= isColoured(more);
    this.pieces.push({ start: at, count });
    this.shown = at + count;
  }

  /** Draws next what lies between two shares of every piece: 0 and 1 are all, 0 and 0.1 an even tenth. */
  select(from: number, to: number): void {
    this.geometry.clearGroups();
    if (from <= 0 && to >= 1) return this.geometry.addGroup(0, this.shown, 0);
    for (const { start, count } of this.pieces) {
      const [first, last] = [Math.floor(count * from), Math.floor(count * to)];
      if (last > first) this.geometry.addGroup(start + first, last - first, 0);
    }
  }

  /** Every point's x, y, z in metres, and its class and clip as [`Points`] has them. */
  get raw(): Points {
    return this.points;
  }
}

/** The fourth value of a tint is no colour. */
function isColoured({ tint }: Points): boolean {
  return tint.some((value, i) => value > 0 && i % 4 < 3);
}

/**
 * The reason why the worker does not run. A browser does not tell it: the connection may have been lost, or the script is gone, since
 * the tab was opened before an upgrade of the service.
 */
async function faultOfWorker(signal: AbortSignal): Promise<Error> {
  try {
    await (await file(POINTS_WORKER, null, signal)).body?.cancel();
  } catch (error) {
    if (error instanceof Refusal && retryDelay_ms(error, 1) !== null) return error;
  }
  return new Error("The points could not be read in this browser. Reload the page: the service may have a newer one.");
}

/** Loads the points at an address, unless they are those with the `ETag` that is known. */
export function load(url: string, arrival: Arrival, signal: AbortSignal, known: string | null = null): void {
  if (signal.aborted) return;
  const worker = new Worker(POINTS_WORKER, { type: "module" });
  const stop = () => {
    // The signal outlives failed attempts, and would keep the points of each of them.
    signal.removeEventListener("abort", stop);
    worker.terminate();
  };
  signal.addEventListener("abort", stop);
  let cloud: Cloud | null = null;
  worker.onmessage = ({ data }: MessageEvent<Told>) => {
    if (data.what === "begin") {
      cloud = new Cloud(data.count, data.hasClips, data.tag);
      arrival.begun(cloud);
    } else if (data.what === "points" && cloud) {
      cloud.add(data.at, data.points);
      arrival.grown(cloud);
    } else if (data.what === "same") {
      arrival.same?.();
    } else if (data.what === "nothing") {
      arrival.nothing();
    } else if (data.what === "failed") {
      const { status, message, retryAfter_s } = data;
      arrival.failed(status === null ? new Error(message) : new Refusal(status, message, retryAfter_s));
    } else if (data.what === "end" && cloud) {
      arrival.ended(cloud);
    }
    if (data.what !== "begin" && data.what !== "points") stop();
  };
  worker.onerror = () => {
    void faultOfWorker(signal).then((error) => signal.aborted || arrival.failed(error));
    stop();
  };
  const ask: Ask = { url, known };
  worker.postMessage(ask);
}
