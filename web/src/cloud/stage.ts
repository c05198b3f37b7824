// The three-dimensional stage: a camera one can walk around with by mouse, touch and keys, and pictures that are
// drawn only when something changed.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { h } from "../dom.ts";
import { fitted, freePart, withSurroundings } from "./fit.ts";
import type { Point3, Ray } from "./pick.ts";

/** A frame that takes longer draws fewer points the next time, and one that takes less more. */
const SLOW_MS = 33;
const FAST_MS = 24;
/** Points of the first frame, before the speed of this machine is known. */
const FIRST_BUDGET = 50_000;
const LEAST_BUDGET = 15_000;
/** A picture that stands still is complete after so many frames at the most. */
const MOST_FRAMES = 30;
/** The picture is completed when nothing moved for so long. */
const SETTLED_MS = 120;
/** The share of the pixels along each side that a coarse picture has. */
const COARSE = 0.5;
/** A press that moves further is a turn of the view and no click. */
const CLICK_PX = 5;
const FLIGHT_MS = 450;
/** The direction from a scene to an eye at a corner above it. */
const FROM_CORNER = new THREE.Vector3(-0.55, -0.85, 0.95);

/** What `look` shows. */
interface Scene {
  /** Around everything; the range of the zoom depends on it. */
  box: THREE.Box3;
  /** The points that are in the picture. */
  outline: THREE.Vector3[];
}

/** The eye of a person and the point it looks at, in metres. */
export interface Viewpoint {
  eye_m: Point3;
  target_m: Point3;
}

export interface Moment {
  camera: THREE.PerspectiveCamera;
  width: number;
  height: number;
}

/** A cloud that can be drawn in parts, each of which is an even sample of the whole. */
export interface Parts {
  count(): number;
  /** True if it can be drawn whole but coarsely. */
  hasCoarse: boolean;
  /** Draws next the part between two shares; `focal_px` is a metre's size at one metre. */
  select(from: number, to: number, focal_px: number, isRough: boolean): void;
  /** Draws next the whole, coarsely. */
  selectCoarse(): void;
}

export class Stage {
  readonly element: HTMLElement;
  /** Drawn first, and whole. */
  readonly shapes = new THREE.Scene();
  /** Drawn over the shapes, as many points in a frame as this machine can. */
  readonly cloud = new THREE.Scene();
  /** Drawn last, over everything. */
  readonly marks = new THREE.Scene();
  parts: Parts | null = null;
  readonly camera = new THREE.PerspectiveCamera(50, 1, 0.05, 500);
  /** Called after each frame, to lay names over it. */
  onDrawn: (moment: Moment) => void = () => {};
  /** Called after the view came to rest. */
  onRest: (eye: THREE.Vector3) => void = () => {};
  /** Called after a person moved the view. */
  onMoved: () => void = () => {};
  /** Called after a click, with the ray through its pixel and the angle that a few pixels are there. */
  onClick: (ray: Ray, reach_rad: number) => void = () => {};
  private readonly renderer: THREE.WebGLRenderer;
  private readonly controls: OrbitControls;
  private readonly pixelRatio = Math.min(devicePixelRatio, 2);
  private isSlow = false;
  private isCoarse = false;
  private asked = 0;
  private settling = 0;
  private isMoving = false;
  /** The frame that is being drawn, and when it was asked for. The next one waits for it, so that what somebody does
   * never queues behind more than one. */
  private drawing: { fence: WebGLSync; since_ms: number } | null = null;
  private budget = FIRST_BUDGET;
  /** The share of the cloud that the picture has; what is there stays until something changes. */
  private done = 0;
  private isStale = true;
  /** The view to show as soon as the stage has a size. */
  private pending: { scene: Scene; from: "corner" | "above" } | null = null;
  /** The last look at a whole scene; null after a flight. */
  private looked: { scene: Scene; from: "corner" | "above"; at: string } | null = null;
  private flight = 0;

  constructor(label: string, signal: AbortSignal) {
    this.renderer = new THREE.WebGLRenderer({ antialias: false, alpha: true, preserveDrawingBuffer: true, powerPreference: "high-performance" });
    this.renderer.autoClear = false;
    this.renderer.localClippingEnabled = true;
    this.renderer.setPixelRatio(this.pixelRatio);
    const canvas = this.renderer.domElement;
    canvas.tabIndex = 0;
    // A screen reader gives the keys of an application to the page, and those of a picture not.
    canvas.setAttribute("role", "application");
    canvas.setAttribute("aria-label", label);
    this.element = h("div", { class: "stage-3d" }, canvas);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.maxPolarAngle = Math.PI * 0.495;
    this.controls.minDistance = 0.3;
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("change", () => this.draw());
    this.controls.addEventListener("end", () => this.onMoved());
    canvas.addEventListener("keydown", (event) => this.onKey(event), { signal });
    this.listenForClicks(canvas, signal);
    canvas.addEventListener("wheel", () => cancelAnimationFrame(this.flight), { signal, passive: true });
    // A phone takes the context from a tab in the background.
    canvas.addEventListener("webglcontextrestored", () => this.draw(), { signal });
    const sizes = new ResizeObserver(() => this.resize());
    sizes.observe(this.element);
    signal.addEventListener("abort", () => {
      sizes.disconnect();
      cancelAnimationFrame(this.asked);
      cancelAnimationFrame(this.flight);
      clearTimeout(this.settling);
      this.controls.dispose();
      this.renderer.dispose();
      this.renderer.forceContextLoss();
    });
  }

  /** Draws afresh, soon: at first as many points as one frame allows, and all of them when nothing changed for a while. */
  draw(): void {
    this.isMoving = true;
    clearTimeout(this.settling);
    this.settling = window.setTimeout(() => {
      this.isMoving = false;
      this.onRest(this.camera.position);
      this.redraw();
    }, SETTLED_MS);
    this.redraw();
  }

  private redraw(): void {
    this.isStale = true;
    this.ask();
  }

  private ask(): void {
    if (!this.asked) this.asked = requestAnimationFrame(() => this.frame());
  }

  /** Looks at a scene from a corner above it, or straight down. */
  look(scene: Scene, from: "corner" | "above" = "corner"): void {
    const { box, outline } = scene;
    if (box.isEmpty()) return;
    cancelAnimationFrame(this.flight);
    const { width, height } = this.size();
    if (width === 0 || height === 0) {
      this.pending = { scene, from };
      return;
    }
    this.camera.aspect = width / height;
    this.reach(box.getBoundingSphere(new THREE.Sphere()));
    const direction = from === "above" ? new THREE.Vector3(0, -0.001, 1) : FROM_CORNER;
    const { eye_m, target_m } = this.framed(outline, direction);
    this.controls.target.fromArray(target_m);
    this.camera.position.fromArray(eye_m);
    this.controls.update();
    this.looked = { scene, from, at: JSON.stringify(this.viewpoint) };
    this.draw();
  }

  /** The nearest viewpoint in a direction that has all points between the tools and the notes. */
  private framed(points: readonly THREE.Vector3[], towardsEye: THREE.Vector3): Viewpoint {
    const { width, height } = this.size();
    const up = Math.tan(THREE.MathUtils.degToRad(this.camera.fov / 2));
    const part = (name: string) => this.element.closest(".stage")?.querySelector<HTMLElement>(name);
    const [tools, notes] = [part(".toolbar"), part(".stage-notes")];
    const tools_px = tools ? tools.offsetTop + tools.offsetHeight : 0;
    // On a wide page the notes are in a corner.
    const notes_px = notes && notes.offsetWidth > width / 2 ? notes.offsetHeight : 0;
    return fitted(points, towardsEye, [(up * width) / height, up], freePart(width, height, tools_px, notes_px));
  }

  /** Fits the depth range and the zoom to a sphere. */
  private reach(sphere: THREE.Sphere): void {
    // The narrower side of the stage decides the distance.
    const half = THREE.MathUtils.degToRad(this.camera.fov / 2);
    const narrow = Math.atan(Math.tan(half) * Math.min(1, this.camera.aspect));
    const distance = (Math.max(0.5, sphere.radius) / Math.sin(narrow)) * 0.86;
    this.camera.near = distance / 500;
    this.camera.far = distance * 20;
    this.camera.updateProjectionMatrix();
    this.controls.maxDistance = distance * 6;
  }

  /** Flies to an object or a room without turning the view. */
  fly(points: readonly THREE.Vector3[]): void {
    if (points.length === 0 || this.size().width === 0) return;
    // The stage may have got its size, and not yet the view that waits for it.
    this.lookAtPending();
    const arm = this.camera.position.clone().sub(this.controls.target);
    if (arm.lengthSq() === 0) arm.copy(FROM_CORNER);
    // A view from a low angle ends in the walls around a room, or in those of the rooms before it.
    arm.z = Math.max(arm.z, 1.8 * Math.hypot(arm.x, arm.y));
    const { eye_m, target_m } = this.framed(withSurroundings(points), arm);
    this.moveTo(new THREE.Vector3(...eye_m), new THREE.Vector3(...target_m));
  }

  get viewpoint(): Viewpoint {
    return { eye_m: this.camera.position.toArray(), target_m: this.controls.target.toArray() };
  }

  /** Looks from a viewpoint at a scene that lies in a box. */
  lookFrom({ eye_m, target_m }: Viewpoint, box: THREE.Box3): void {
    // A stage without a size would look at the whole box once it gets one.
    this.pending = null;
    cancelAnimationFrame(this.flight);
    if (!box.isEmpty()) this.reach(box.getBoundingSphere(new THREE.Sphere()));
    this.controls.target.fromArray(target_m);
    this.camera.position.fromArray(eye_m);
    this.controls.update();
    this.draw();
  }

  private moveTo(eye: THREE.Vector3, target: THREE.Vector3): void {
    cancelAnimationFrame(this.flight);
    this.looked = null;
    const from = { eye: this.camera.position.clone(), target: this.controls.target.clone() };
    const length_ms = matchMedia("(prefers-reduced-motion: reduce)").matches ? 0 : FLIGHT_MS;
    const begun = performance.now();
    const step = () => {
      const part = length_ms > 0 ? Math.min(1, (performance.now() - begun) / length_ms) : 1;
      const eased = part * part * (3 - 2 * part);
      this.camera.position.lerpVectors(from.eye, eye, eased);
      this.controls.target.lerpVectors(from.target, target, eased);
      this.controls.update();
      this.draw();
      if (part < 1) this.flight = requestAnimationFrame(step);
      else this.onMoved();
    };
    step();
  }

  private listenForClicks(canvas: HTMLCanvasElement, signal: AbortSignal): void {
    let press: { x: number; y: number } | null = null;
    canvas.addEventListener("pointerdown", (event) => {
      cancelAnimationFrame(this.flight);
      press = event.isPrimary && event.button === 0 ? { x: event.clientX, y: event.clientY } : null;
    }, { signal });
    canvas.addEventListener("pointerup", (event) => {
      const isClick = press && Math.hypot(event.clientX - press.x, event.clientY - press.y) < CLICK_PX;
      press = null;
      if (!isClick) return;
      const box = canvas.getBoundingClientRect();
      const [x, y] = [(event.clientX - box.x) / box.width, (event.clientY - box.y) / box.height];
      this.onClick(...this.rayAt(2 * x - 1, 1 - 2 * y));
    }, { signal });
  }

  /** The ray through a place of the picture, whose sides are at -1 and 1, and the angle that a few pixels are there. */
  rayAt(x: number, y: number): [ray: Ray, reach_rad: number] {
    const caster = new THREE.Raycaster();
    // The view may have moved since the last frame.
    this.camera.updateMatrixWorld();
    caster.setFromCamera(new THREE.Vector2(x, y), this.camera);
    const pixel_rad = (2 * Math.tan(THREE.MathUtils.degToRad(this.camera.fov / 2))) / this.size().height;
    const { origin, direction } = caster.ray;
    return [{ origin: origin.toArray(), direction: direction.toArray() }, CLICK_PX * pixel_rad];
  }

  /** Draws as much as fits into a frame, and asks for the next one while something is left. */
  private frame(): void {
    this.asked = 0;
    const { width, height } = this.size();
    if (width === 0 || height === 0) return;
    if (!this.isDrawn()) {
      this.ask();
      return;
    }
    if (this.isStale) this.sharpen();
    const ratio = this.renderer.getPixelRatio();
    if (this.isStale) {
      this.isStale = false;
      this.done = 0;
      this.renderer.clear();
      this.renderer.render(this.shapes, this.camera);
      this.onDrawn({ camera: this.camera, width, height });
    }
    const { parts, isCoarse } = this;
    const count = parts?.count() ?? 0;
    // A surface that moves on a fast machine is drawn at once.
    const isWhole = count === 0 || isCoarse || (this.isMoving && parts?.hasCoarse);
    const isFirst = this.done === 0;
    const until = isWhole ? 1 : Math.min(1, this.done + this.budget / count);
    const focal_px = (height * ratio) / (2 * Math.tan(THREE.MathUtils.degToRad(this.camera.fov / 2)));
    if (isCoarse) parts?.selectCoarse();
    else parts?.select(this.done, until, focal_px, this.isMoving);
    this.renderer.render(this.cloud, this.camera);
    // Marks shine through, so they are not drawn over themselves with every part.
    if (isFirst || until >= 1) this.renderer.render(this.marks, this.camera);
    this.done = until;
    this.mark();
    // A view that moves is drawn afresh anyway.
    if (this.done < 1 && !this.isMoving) this.ask();
    this.element.dataset.done = String(this.done);
  }

  /** Draws a surface more coarsely while the view moves on a slow machine. Points are drawn in parts instead. */
  private sharpen(): void {
    const isCoarse = this.isMoving && this.isSlow && !!this.parts?.hasCoarse;
    if (isCoarse === this.isCoarse) return;
    this.isCoarse = isCoarse;
    this.renderer.setPixelRatio(this.pixelRatio * (isCoarse ? COARSE : 1));
  }

  /** Notes that a frame is on its way to the graphics card. */
  private mark(): void {
    const gl = this.renderer.getContext() as WebGL2RenderingContext;
    const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    this.drawing = fence && { fence, since_ms: performance.now() };
  }

  /** True if the last frame is drawn; measures with it how fast this machine draws. */
  private isDrawn(): boolean {
    if (!this.drawing) return true;
    const gl = this.renderer.getContext() as WebGL2RenderingContext;
    const { fence, since_ms } = this.drawing;
    if (!gl.isContextLost() && gl.clientWaitSync(fence, 0, 0) === gl.TIMEOUT_EXPIRED) return false;
    gl.deleteSync(fence);
    this.drawing = null;
    this.adapt(performance.now() - since_ms);
    return true;
  }

  private adapt(took_ms: number): void {
    if (took_ms > SLOW_MS) this.isSlow = true;
    const count = this.parts?.count() ?? 0;
    const least = this.isMoving ? LEAST_BUDGET : Math.max(LEAST_BUDGET, count / MOST_FRAMES);
    if (took_ms > SLOW_MS) this.budget = Math.max(least, this.budget * Math.max(0.3, SLOW_MS / took_ms));
    else if (took_ms < FAST_MS && this.budget < count) this.budget *= 1.4;
  }

  private size(): { width: number; height: number } {
    return { width: this.element.clientWidth, height: this.element.clientHeight };
  }

  private resize(): void {
    const { width, height } = this.size();
    if (width === 0 || height === 0) return;
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.renderer.setSize(width, height);
    if (this.pending) this.lookAtPending();
    // A phone was turned: a view that nobody moved shows the whole scene again.
    else if (this.looked?.at === JSON.stringify(this.viewpoint)) this.look(this.looked.scene, this.looked.from);
    this.draw();
  }

  private lookAtPending(): void {
    if (this.pending) this.look(this.pending.scene, this.pending.from);
    this.pending = null;
  }

  private onKey(event: KeyboardEvent): void {
    const step = event.shiftKey ? 0.05 : 0.12;
    const turns: Record<string, [number, number]> = {
      ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step],
    };
    const walks: Record<string, [number, number]> = { a: [-1, 0], d: [1, 0], w: [0, 1], s: [0, -1] };
    const zooms: Record<string, number> = { "+": 0.85, "=": 0.85, "-": 1 / 0.85 };
    const [turn, walk, zoom] = [turns[event.key], walks[event.key.toLowerCase()], zooms[event.key]];
    if (event.ctrlKey || event.metaKey || event.altKey || !(turn || walk || zoom)) return;
    event.preventDefault();
    cancelAnimationFrame(this.flight);
    const arm = this.camera.position.clone().sub(this.controls.target);
    if (turn) {
      const around = new THREE.Spherical().setFromVector3(new THREE.Vector3(arm.x, arm.z, -arm.y));
      around.theta += turn[0];
      around.phi = THREE.MathUtils.clamp(around.phi + turn[1], 0.001, Math.PI * 0.495);
      const turned = new THREE.Vector3().setFromSpherical(around);
      arm.set(turned.x, -turned.z, turned.y);
    }
    if (zoom) arm.multiplyScalar(zoom);
    if (walk) {
      const ahead = new THREE.Vector3(-arm.x, -arm.y, 0).normalize().multiplyScalar(arm.length() * 0.06);
      const aside = new THREE.Vector3(ahead.y, -ahead.x, 0);
      this.controls.target.addScaledVector(ahead, walk[1]).addScaledVector(aside, walk[0]);
    }
    this.camera.position.copy(this.controls.target).add(arm);
    this.controls.update();
    this.draw();
    this.onMoved();
  }
}
