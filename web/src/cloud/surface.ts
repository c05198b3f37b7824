// The surface of a home as triangles, coloured and cut by the graphics card as points are.

import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { clustered } from "./coarse.ts";
import type { Parts } from "./stage.ts";
import { type Colouring, rgb } from "./colours.ts";
import { NO_CUT_M } from "./material.ts";

/** Classes of which only the side towards the eye is drawn, so that one looks over the near walls into the rooms. */
export const OF_SHELL: ReadonlySet<string> = new Set(["wall", "ceiling", "window", "door", "curtain", "picture", "mirror", "radiator"]);

/** Side of the cells that become one vertex in the coarse surface. */
const CELL_M = 0.12;

const VERTEX = /* glsl */ `
in vec4 color;
out vec3 tint;
out float height_m;
out float facing;
void main() {
  vec4 place = modelMatrix * vec4(position, 1.0);
  vec4 eye = viewMatrix * place;
  gl_Position = projectionMatrix * eye;
  tint = color.rgb;
  height_m = place.z;
  // Negative where the eye is behind the surface.
  facing = dot(normalize(normalMatrix * normal), -normalize(eye.xyz));
}`;

const FRAGMENT = /* glsl */ `
uniform bool is_flat;
uniform bool is_shell;
uniform vec3 paint;
uniform float cut_m;
in vec3 tint;
in float height_m;
in float facing;
out vec4 pixel;

vec3 screen(vec3 light) {
  return mix(12.92 * light, 1.055 * pow(light, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, light));
}

void main() {
  if (height_m > cut_m || (is_shell && facing < 0.0)) discard;
  float share = abs(facing);
  pixel = vec4(is_flat ? paint * (0.62 + 0.38 * share) : screen(tint) * (0.86 + 0.14 * share), 1.0);
}`;

/** The name and the colour of a class. */
export interface ClassLook {
  name: string;
  color: string;
  isShown: boolean;
}

interface OfClass {
  material: THREE.ShaderMaterial;
  paint: THREE.Vector3;
  meshes: THREE.Mesh[];
}

export class Surface implements Parts {
  /** In the map's frame. */
  readonly group = new THREE.Group();
  readonly triangles: number;
  private readonly indices: { geometry: THREE.BufferGeometry; fine: THREE.BufferAttribute; coarse: THREE.BufferAttribute }[] = [];
  private readonly byClass = new Map<string, OfClass>();
  /** Of the materials of all classes. */
  private readonly uniforms = { is_flat: { value: false }, cut_m: { value: NO_CUT_M } };

  constructor(scene: THREE.Object3D) {
    // The file has y up.
    this.group.rotation.x = Math.PI / 2;
    const meshes: THREE.Mesh[] = [];
    scene.traverse((object) => {
      if (object instanceof THREE.Mesh) meshes.push(object);
    });
    let triangles = 0;
    for (const mesh of meshes) {
      const name = String(mesh.userData.class ?? "other");
      const one = this.byClass.get(name) ?? this.classOf(name);
      this.byClass.set(name, one);
      for (const old of [mesh.material].flat()) old.dispose();
      mesh.material = one.material;
      mesh.matrixAutoUpdate = false;
      one.meshes.push(mesh);
      const fine = mesh.geometry.index;
      if (fine) this.indices.push({ geometry: mesh.geometry, fine, coarse: coarseOf(mesh.geometry, fine) });
      triangles += (fine?.count ?? 0) / 3;
      this.group.add(mesh);
    }
    this.triangles = triangles;
  }

  private classOf(name: string): OfClass {
    const paint = new THREE.Vector3(0.6, 0.6, 0.6);
    const material = new THREE.ShaderMaterial({
      glslVersion: THREE.GLSL3,
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      side: THREE.DoubleSide,
      uniforms: { ...this.uniforms, is_shell: { value: OF_SHELL.has(name) }, paint: { value: paint } },
    });
    return { material, paint, meshes: [] };
  }

  /** Points have clips and probabilities; a surface has colours and classes. */
  setColouring(colouring: Colouring): void {
    this.uniforms.is_flat.value = colouring === "class";
  }

  readonly hasCoarse = true;

  count(): number {
    return this.group.visible ? this.triangles : 0;
  }

  selectCoarse(): void {
    for (const { geometry, coarse } of this.indices) {
      geometry.setIndex(coarse);
      geometry.setDrawRange(0, Infinity);
    }
  }

  select(from: number, to: number): void {
    const [first, last] = [Math.floor(from * this.triangles), Math.floor(to * this.triangles)];
    let at = 0;
    for (const { geometry, fine } of this.indices) {
      const count = fine.count / 3;
      const [low, high] = [Math.max(0, first - at), Math.min(count, last - at)];
      geometry.setIndex(fine);
      geometry.setDrawRange(3 * low, 3 * Math.max(0, high - low));
      at += count;
    }
  }

  setCut(height_m: number): void {
    this.uniforms.cut_m.value = height_m;
  }

  setClasses(looks: readonly ClassLook[]): void {
    for (const { name, color, isShown } of looks) {
      const one = this.byClass.get(name);
      if (!one) continue;
      one.paint.fromArray(rgb(color)).divideScalar(255);
      for (const mesh of one.meshes) mesh.visible = isShown;
    }
  }

  dispose(): void {
    for (const { material, meshes } of this.byClass.values()) {
      material.dispose();
      for (const mesh of meshes) mesh.geometry.dispose();
    }
    this.group.clear();
  }
}

/** Reads a GLB of the service. */
export async function readSurface(bytes: ArrayBuffer): Promise<Surface> {
  const { scene } = await new GLTFLoader().parseAsync(bytes, "");
  return new Surface(scene);
}

function coarseOf(geometry: THREE.BufferGeometry, fine: THREE.BufferAttribute): THREE.BufferAttribute {
  const position = geometry.getAttribute("position");
  // The attributes of a vertex lie together in the file; its position comes first.
  const [places, stride] = position instanceof THREE.InterleavedBufferAttribute
    ? [position.data.array.subarray(position.offset), position.data.stride]
    : [position.array, position.itemSize];
  return new THREE.BufferAttribute(clustered(places, stride, fine.array, CELL_M), 1);
}
