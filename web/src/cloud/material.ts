// Draws points. Their colours and the selection of the shown ones are textures and numbers that the graphics card looks
// up, so switching costs nothing, however many points there are.

import * as THREE from "three";
import { COLOURINGS, type Colouring, RAMP, type Rgb } from "./colours.ts";

const CLIP_SIDE = 256;
/** The height of a cut that cuts nothing. */
export const NO_CUT_M = 1e9;

const VERTEX = /* glsl */ `
uniform sampler2D classes;
uniform sampler2D clips;
uniform int colouring;
uniform float cut_m;
uniform float size_px_m;
uniform vec3 ramp[${RAMP.length}];
in vec4 tint;
in vec4 kind;
in vec4 shade;
out vec3 paint;

vec3 ramped(float share) {
  float place = clamp(share, 0.0, 1.0) * ${(RAMP.length - 1).toFixed(1)};
  int low = min(int(place), ${RAMP.length - 2});
  return mix(ramp[low], ramp[low + 1], place - float(low));
}

void main() {
  vec4 named = texelFetch(classes, ivec2(int(kind.x + 0.5), 0), 0);
  vec4 source = texelFetch(clips, ivec2(int(kind.z + 0.5), int(kind.w + 0.5)), 0);
  bool hidden = named.a < 0.5 || source.a < 0.5 || position.z > cut_m;
  if (hidden) {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    gl_PointSize = 1.0;
    return;
  }
  vec4 eye = modelViewMatrix * vec4(position, 1.0);
  gl_Position = projectionMatrix * eye;
  gl_PointSize = clamp(size_px_m / max(-eye.z, 0.05), 1.0, 40.0);
  // Surfaces that face the eye are lighter; a normal may point to either side.
  float facing = dot(shade.xyz, shade.xyz) > 0.1
    ? abs(dot(normalize(normalMatrix * shade.xyz), normalize(eye.xyz))) : 0.7;
  if (colouring == 0) {
    paint = tint.rgb * (0.86 + 0.14 * facing);
  } else {
    vec3 flat_paint = colouring == 1 ? named.rgb : colouring == 2 ? source.rgb : ramped(kind.y / 255.0);
    paint = flat_paint * (0.62 + 0.38 * facing);
  }
}`;

const FRAGMENT = /* glsl */ `
in vec3 paint;
out vec4 pixel;
void main() {
  pixel = vec4(paint, 1.0);
}`;

/** One row or square of colours, the fourth channel telling whether the entry is shown. */
class Palette {
  readonly texture: THREE.DataTexture;
  private readonly data: Uint8Array<ArrayBuffer>;

  constructor(width: number, height: number) {
    this.data = new Uint8Array(width * height * 4).fill(255);
    this.texture = new THREE.DataTexture(this.data, width, height);
    this.texture.needsUpdate = true;
  }

  set(index: number, [red, green, blue]: Rgb, isShown: boolean): void {
    if (4 * index + 3 < this.data.length) this.data.set([red, green, blue, isShown ? 255 : 0], 4 * index);
    this.texture.needsUpdate = true;
  }
}

export class PointMaterial {
  readonly classes = new Palette(256, 1);
  readonly clips = new Palette(CLIP_SIDE, CLIP_SIDE);
  private readonly uniforms = {
    classes: { value: this.classes.texture },
    clips: { value: this.clips.texture },
    colouring: { value: 0 },
    cut_m: { value: NO_CUT_M },
    size_px_m: { value: 1 },
    ramp: { value: RAMP.map(([r, g, b]) => new THREE.Vector3(r / 255, g / 255, b / 255)) },
  };
  readonly material = new THREE.ShaderMaterial({
    glslVersion: THREE.GLSL3,
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    uniforms: this.uniforms,
  });

  set colouring(colouring: Colouring) {
    this.uniforms.colouring.value = COLOURINGS.indexOf(colouring);
  }

  /** Points higher than this are not drawn. */
  set cut_m(height: number) {
    this.uniforms.cut_m.value = height;
  }

  /** Width of a point on the screen at one metre, in device pixels. */
  set size_px_m(size: number) {
    this.uniforms.size_px_m.value = size;
  }

  dispose(): void {
    this.material.dispose();
    this.classes.texture.dispose();
    this.clips.texture.dispose();
  }
}
