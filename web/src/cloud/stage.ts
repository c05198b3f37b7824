// The three-dimensional stage: a camera one can walk around with by mouse, touch and keys, and pictures that are
// drawn only when something changed.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { h } from "../dom.ts";

/** While the view moves, a frame should take at most this long; where it takes longer, less is drawn. */
const SMOOTH_MS = 40;
/** The picture becomes sharp when nothing moved for so long. */
const SETTLED_MS = 180;
const MAX_ROUGHNESS = 5;

export interface Moment {
  camera: THREE.PerspectiveCamera;
  width: number;
  height: number;
}

export class Stage {
  readonly element: HTMLElement;
  readonly scene = new THREE.Scene();
  readonly camera = new THREE.PerspectiveCamera(50, 1, 0.05, 500);
  /** Told before each frame: device pixels per metre at one metre, and of how many points one is drawn. */
  onFrame: (size_px_m: number, thin: number) => void = () => {};
  /** Told after each frame, to lay names over it. */
  onDrawn: (moment: Moment) => void = () => {};
  private readonly renderer: THREE.WebGLRenderer;
  private readonly controls: OrbitControls;
  private asked = 0;
  private settling = 0;
  private isMoving = false;
  private lastFrame_ms = 0;
  /** 0 draws everything; each step halves the work of a frame. */
  private roughness = 0;
  private target = { centre: new THREE.Vector3(), radius: 5 };

  constructor(label: string, signal: AbortSignal) {
    this.renderer = new THREE.WebGLRenderer({ antialias: false, alpha: true, powerPreference: "high-performance" });
    const canvas = this.renderer.domElement;
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", label);
    this.element = h("div", { class: "stage-3d" }, canvas);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.maxPolarAngle = Math.PI * 0.495;
    this.controls.minDistance = 0.3;
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("change", () => this.move());
    canvas.addEventListener("keydown", (event) => this.onKey(event), { signal });
    const sizes = new ResizeObserver(() => this.resize());
    sizes.observe(this.element);
    signal.addEventListener("abort", () => {
      sizes.disconnect();
      cancelAnimationFrame(this.asked);
      clearTimeout(this.settling);
      this.controls.dispose();
      this.renderer.dispose();
      this.renderer.forceContextLoss();
    });
  }

  /** Draws once, soon. */
  draw(): void {
    if (!this.asked) this.asked = requestAnimationFrame((now) => this.frame(now));
  }

  /** Looks at a box from a corner above it, or straight down. */
  look(box: THREE.Box3, from: "corner" | "above" = "corner"): void {
    if (box.isEmpty()) return;
    const sphere = box.getBoundingSphere(new THREE.Sphere());
    this.target = { centre: sphere.center.clone(), radius: Math.max(0.5, sphere.radius) };
    const direction =
      from === "above" ? new THREE.Vector3(0, -0.001, 1) : new THREE.Vector3(-0.55, -0.85, 0.95);
    // The narrower side of the stage decides how far away everything fits.
    const half = THREE.MathUtils.degToRad(this.camera.fov / 2);
    const narrow = Math.atan(Math.tan(half) * Math.min(1, this.camera.aspect));
    const distance = (this.target.radius / Math.sin(narrow)) * 0.86;
    this.controls.target.copy(this.target.centre);
    this.camera.position.copy(this.target.centre).addScaledVector(direction.normalize(), distance);
    this.camera.near = distance / 500;
    this.camera.far = distance * 20;
    this.camera.updateProjectionMatrix();
    this.controls.maxDistance = distance * 6;
    this.controls.update();
    this.draw();
  }

  private move(): void {
    this.isMoving = true;
    clearTimeout(this.settling);
    this.settling = window.setTimeout(() => {
      this.isMoving = false;
      this.lastFrame_ms = 0;
      this.draw();
    }, SETTLED_MS);
    this.draw();
  }

  private frame(now: number): void {
    this.asked = 0;
    const { width, height } = this.size();
    if (width === 0 || height === 0) return;
    if (this.isMoving && this.lastFrame_ms > 0) {
      const took = now - this.lastFrame_ms;
      if (took > SMOOTH_MS) this.roughness = Math.min(MAX_ROUGHNESS, this.roughness + 1);
      else if (took < SMOOTH_MS / 2.2) this.roughness = Math.max(0, this.roughness - 1);
    }
    if (this.isMoving) this.lastFrame_ms = now;
    const roughness = this.isMoving ? this.roughness : 0;
    const sharp = Math.min(devicePixelRatio, 2);
    const ratio = Math.max(0.5, sharp / 2 ** (roughness / 2));
    if (this.renderer.getPixelRatio() !== ratio) this.renderer.setPixelRatio(ratio);
    const focal = (height * ratio) / (2 * Math.tan(THREE.MathUtils.degToRad(this.camera.fov / 2)));
    this.onFrame(focal, 2 ** Math.max(0, roughness - 1));
    this.renderer.render(this.scene, this.camera);
    this.onDrawn({ camera: this.camera, width, height });
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
    this.draw();
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
    this.move();
  }
}
