// A home from above: the LiDAR map's picture and what lies on it, to be moved and magnified by mouse, touch and
// keys. One unit of the drawing is a centimetre; y is turned so that it goes up.

import { s } from "../dom.ts";
import type { Box2, Point2 } from "../frames.ts";
import { arrange, shortened, textWidth } from "../parts/labels.ts";
import type { PictureFrame, Pose2 } from "../types.ts";

const UNITS = 100;
/** Around an object that is shown: so much of its room is in sight that a person sees where it is. */
const AROUND_M = 2;
/** A press that moves further is a drag and no click. */
const CLICK_PX = 5;
/** Of a name on the screen; the fonts are those of the style sheet. */
const NAME_PX = 15;
const GAP_PX = 6;
const MOST_NAME_PX = 220;
const FONTS: Record<string, string> = { "room-name": "650 13px", "thing-name": "400 11px" };

/** A point of the map's frame in the drawing. */
export function at([x, y]: Point2): string {
  return `${(x * UNITS).toFixed(1)},${(-y * UNITS).toFixed(1)}`;
}

/** A pose as the transform of an SVG, whose y goes down. */
export function turned({ x_m, y_m, yaw_rad }: Pose2): string {
  return `translate(${at([x_m, y_m])}) rotate(${((-yaw_rad * 180) / Math.PI).toFixed(3)})`;
}

interface Window {
  x: number;
  y: number;
  width: number;
  height: number;
}

export class PlanView {
  readonly element: SVGSVGElement;
  private readonly points = s("image", { class: "points", preserveAspectRatio: "none" });
  private readonly picture = s("image", { class: "picture", preserveAspectRatio: "none" });
  private readonly layers = new Map<string, SVGGElement>();
  private names: { element: SVGTextElement; x: number; y: number; width_px: number }[] = [];
  private home: Window = { x: 0, y: 0, width: 100, height: 100 };
  private window: Window = this.home;
  private readonly fingers = new Map<number, { x: number; y: number }>();
  /** The start of a press that has not become a drag. */
  private press: { x: number; y: number } | null = null;
  /** Called after a click, with its point in the map's frame. */
  onClick: (point: Point2) => void = () => {};
  /** Called after another part is shown. */
  onShown: () => void = () => {};
  /** Called after a person moved the view. */
  onMoved: () => void = () => {};

  /** A drawing that stays as it is when `signal` is null. */
  constructor(label: string, signal: AbortSignal | null) {
    // A screen reader gives the keys of an application to the page, and those of a picture not.
    this.element = s("svg", { class: "plan", role: signal ? "application" : "img", "aria-label": label });
    this.element.append(this.picture, this.points);
    if (!signal) return;
    this.element.classList.add("movable");
    this.element.setAttribute("tabindex", "0");
    const on = <K extends keyof SVGElementEventMap>(name: K, listen: (event: SVGElementEventMap[K]) => void) =>
      this.element.addEventListener(name, listen, { signal, passive: false });
    on("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(event.deltaY * 0.0015), event.clientX, event.clientY);
    });
    on("pointerdown", (event) => {
      // The browser's menu of the other buttons keeps the release for itself, and the plan would stick to the pointer.
      if (event.button !== 0) return;
      this.element.setPointerCapture(event.pointerId);
      this.fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      this.press = this.fingers.size === 1 ? { x: event.clientX, y: event.clientY } : null;
    });
    on("pointermove", (event) => this.drag(event));
    on("pointerup", (event) => {
      this.fingers.delete(event.pointerId);
      if (this.press) this.onClick(this.pointAt(event.clientX, event.clientY));
      this.press = null;
    });
    on("pointercancel", (event) => this.fingers.delete(event.pointerId));
    on("keydown", (event) => this.onKey(event));
    const sizes = new ResizeObserver(() => this.apply());
    sizes.observe(this.element);
    signal.addEventListener("abort", () => sizes.disconnect());
  }

  /** `at` is the pose of the picture's frame in the map's. */
  setPicture(address: string | null, frame: PictureFrame | null, at: Pose2 | null = null): void {
    lay(this.picture, address, frame);
    if (at) this.picture.setAttribute("transform", turned(at));
    else this.picture.removeAttribute("transform");
  }

  /** A picture of points, over the other. */
  setPoints(address: string | null, frame: PictureFrame | null): void {
    lay(this.points, address, frame);
  }

  showPicture(isShown: boolean): void {
    this.picture.style.display = isShown ? "" : "none";
  }

  /** Replaces a layer; layers lie over each other in the order in which they were first set. */
  setLayer(name: string, ...shapes: SVGElement[]): void {
    let layer = this.layers.get(name);
    if (!layer) {
      layer = s("g", { class: name });
      this.layers.set(name, layer);
      this.element.append(layer);
    }
    layer.replaceChildren(...shapes);
  }

  /** Replaces the names, the most important ones first; a name without room beside the earlier ones is left out. */
  setNames(names: { text: string; at_m: Point2; kind: string }[]): void {
    this.names = names.map(({ text: whole, at_m, kind }) => {
      const [x = "0", y = "0"] = at(at_m).split(",");
      const font = FONTS[kind] ?? "400 12px";
      const text = shortened(whole, font, MOST_NAME_PX);
      const element = s("text", { class: kind, x, y }, text);
      return { element, x: Number(x), y: Number(y), width_px: textWidth(text, font) + GAP_PX };
    });
    this.setLayer("names", ...this.names.map(({ element }) => element));
    this.placeNames();
  }

  private placeNames(): void {
    const perPixel = this.perPixel();
    const shifts = arrange(this.names.map(({ x, y, width_px }) =>
      ({ x, y, width: width_px * perPixel, height: NAME_PX * perPixel })));
    this.names.forEach(({ element, y }, i) => {
      const shift = shifts[i] ?? null;
      element.style.display = shift === null ? "none" : "";
      element.setAttribute("y", String(y + (shift ?? 0)));
    });
  }

  /** Sets the box that is shown until a person moves the view. */
  setBounds(box: Box2, margin_m = 0.3): void {
    const before = this.home;
    this.home = windowOf(box, margin_m);
    if (this.window === before) this.fit();
  }

  fit(): void {
    this.part = null;
  }

  /** Moves to a part of the home, with room around it. */
  show({ min, max }: Box2): void {
    const margin_m = Math.max(AROUND_M, (max[0] - min[0] + max[1] - min[1]) / 4);
    this.window = windowOf({ min, max }, margin_m);
    this.apply();
    this.onMoved();
  }

  /** The shown part in metres; null for all of the home. */
  get part(): Box2 | null {
    if (this.window === this.home) return null;
    const { x, y, width, height } = this.window;
    return { min: [x / UNITS, -(y + height) / UNITS], max: [(x + width) / UNITS, -y / UNITS] };
  }

  set part(box: Box2 | null) {
    this.window = box ? windowOf(box, 0) : this.home;
    this.apply();
  }

  /** The point in the middle. */
  get middle(): Point2 {
    const { x, y, width, height } = this.window;
    return [(x + width / 2) / UNITS, -(y + height / 2) / UNITS];
  }

  private pointAt(clientX: number, clientY: number): Point2 {
    const { x, y, width, height } = this.window;
    const box = this.element.getBoundingClientRect();
    const perPixel = this.perPixel();
    const left = x + width / 2 + (clientX - box.x - box.width / 2) * perPixel;
    const top = y + height / 2 + (clientY - box.y - box.height / 2) * perPixel;
    return [left / UNITS, -top / UNITS];
  }

  private apply(): void {
    const { x, y, width, height } = this.window;
    this.element.setAttribute("viewBox", `${x} ${y} ${width} ${height}`);
    const perPixel = this.perPixel();
    // Texts keep their size on the screen.
    this.element.style.setProperty("--unit", String(perPixel));
    this.placeNames();
    this.onShown();
  }

  /** Units of the drawing for one pixel of the screen. */
  private perPixel(): number {
    const { width, height } = this.window;
    const box = this.element.getBoundingClientRect();
    if (box.width === 0 || box.height === 0) return width / 600;
    return Math.max(width / box.width, height / box.height);
  }

  private zoom(factor: number, clientX?: number, clientY?: number): void {
    const { x, y, width, height } = this.window;
    const bound = this.home.width * 4;
    const scale = Math.min(Math.max(width * factor, 50), bound) / width;
    const box = this.element.getBoundingClientRect();
    const perPixel = this.perPixel();
    const [dx, dy] = [
      ((clientX ?? box.x + box.width / 2) - box.x - box.width / 2) * perPixel,
      ((clientY ?? box.y + box.height / 2) - box.y - box.height / 2) * perPixel,
    ];
    const middle = { x: x + width / 2 + dx, y: y + height / 2 + dy };
    this.window = {
      x: middle.x - dx * scale - (width * scale) / 2,
      y: middle.y - dy * scale - (height * scale) / 2,
      width: width * scale,
      height: height * scale,
    };
    this.apply();
    this.onMoved();
  }

  private pan(dx_px: number, dy_px: number): void {
    const perPixel = this.perPixel();
    this.window = { ...this.window, x: this.window.x - dx_px * perPixel, y: this.window.y - dy_px * perPixel };
    this.apply();
    this.onMoved();
  }

  private drag(event: PointerEvent): void {
    const before = this.fingers.get(event.pointerId);
    if (!before) return;
    const now = { x: event.clientX, y: event.clientY };
    if (this.press && Math.hypot(now.x - this.press.x, now.y - this.press.y) < CLICK_PX) return;
    this.press = null;
    const other = [...this.fingers].find(([id]) => id !== event.pointerId)?.[1];
    this.fingers.set(event.pointerId, now);
    if (!other) return this.pan(now.x - before.x, now.y - before.y);
    const spread = (finger: { x: number; y: number }) => Math.hypot(finger.x - other.x, finger.y - other.y);
    this.zoom(spread(before) / Math.max(1, spread(now)), (now.x + other.x) / 2, (now.y + other.y) / 2);
    this.pan((now.x - before.x) / 2, (now.y - before.y) / 2);
  }

  private onKey(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const pans: Record<string, [number, number]> = {
      ArrowLeft: [60, 0], ArrowRight: [-60, 0], ArrowUp: [0, 60], ArrowDown: [0, -60],
    };
    const pan = pans[event.key];
    if (pan) this.pan(...pan);
    else if (event.key === "+" || event.key === "=") this.zoom(0.8);
    else if (event.key === "-") this.zoom(1.25);
    else if (event.key === "0") {
      this.fit();
      this.onMoved();
    } else return;
    event.preventDefault();
  }
}

function windowOf({ min, max }: Box2, margin_m: number): Window {
  return {
    x: (min[0] - margin_m) * UNITS,
    y: -(max[1] + margin_m) * UNITS,
    width: Math.max(1, max[0] - min[0] + 2 * margin_m) * UNITS,
    height: Math.max(1, max[1] - min[1] + 2 * margin_m) * UNITS,
  };
}

function lay(image: SVGImageElement, address: string | null, frame: PictureFrame | null): void {
  if (!address || !frame) return image.removeAttribute("href");
  const attributes = {
    href: address,
    x: frame.corner_m[0] * UNITS,
    y: -frame.corner_m[1] * UNITS,
    width: (frame.width_px / frame.px_per_m) * UNITS,
    height: (frame.height_px / frame.px_per_m) * UNITS,
  };
  for (const [name, value] of Object.entries(attributes)) image.setAttribute(name, String(value));
}
