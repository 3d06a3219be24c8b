// SPDX-License-Identifier: BSD-2-Clause
// A keyframe's photo all around, laid over the points.
import {
  GLSL3,
  LinearFilter,
  Matrix3,
  Matrix4,
  Mesh,
  NoColorSpace,
  type PerspectiveCamera,
  PlaneGeometry,
  RawShaderMaterial,
  RepeatWrapping,
  Texture,
} from "three";
import { type KeyframeData, imageAddress } from "./data";
import type { Pose } from "./geometry";

const isServed = (): boolean => globalThis.location?.protocol.startsWith("http") ?? false;

/** Whether there is a photo: in the page, or beside it where it is served. */
export const hasPhoto = (keyframe: KeyframeData | undefined): boolean =>
  keyframe?.panorama !== undefined || (keyframe?.photo !== undefined && isServed());

/** Address of a keyframe's photo; "" = none. */
export function photoOf(keyframe: KeyframeData): string {
  if (keyframe.panorama !== undefined) return imageAddress(document, keyframe.panorama);
  return hasPhoto(keyframe) ? keyframe.photo! : "";
}

/** Leaves out the photos beside the page if it is served without them. Returns whether any were. */
export async function leaveOutMissingPhotos(keyframes: KeyframeData[]): Promise<boolean> {
  const first = keyframes.find((it) => it.photo !== undefined)?.photo;
  if (first === undefined || !isServed()) return false;
  const reply = await fetch(first, { method: "HEAD" }).catch(() => null);
  if (reply?.ok) return false;
  for (const keyframe of keyframes) delete keyframe.photo;
  return true;
}

const vertexShader = `
precision highp float;
in vec3 position; uniform mat4 rayFromScreen; out vec3 ray;
void main() {
  vec4 far = rayFromScreen * vec4(position.xy, 1.0, 1.0);
  ray = far.xyz / far.w;
  gl_Position = vec4(position.xy, 0.0, 1.0);
}`;

// Longitude = atan2(x, z), latitude = -asin(y / |p|), in the camera's axes.
const fragmentShader = `
precision highp float;
in vec3 ray; uniform mat3 camFromFile; uniform sampler2D photo; uniform float opacity; out vec4 result;
void main() {
  vec3 p = normalize(camFromFile * ray);
  vec2 place = vec2(0.5 + atan(p.x, p.z) / 6.28318530718, 0.5 + asin(clamp(p.y, -1.0, 1.0)) / 3.14159265359);
  result = vec4(texture(photo, place).rgb, opacity);
}`;

export class Panorama {
  readonly mesh: Mesh;
  private readonly material: RawShaderMaterial;
  private shown = "";

  constructor(private readonly onLoad: () => void) {
    this.material = new RawShaderMaterial({
      glslVersion: GLSL3,
      vertexShader,
      fragmentShader,
      transparent: true,
      depthTest: false,
      depthWrite: false,
      uniforms: {
        rayFromScreen: { value: new Matrix4() },
        camFromFile: { value: new Matrix3() },
        photo: { value: null },
        opacity: { value: 1 },
      },
    });
    this.mesh = new Mesh(new PlaneGeometry(2, 2), this.material);
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = 1;
    this.mesh.visible = false;
  }

  /** `address`: "" = there is no photo. */
  show(address: string, pose: Pose): void {
    const r = pose.rotation;
    const n = (i: number): number => r[i] ?? 0;
    this.material.uniforms["camFromFile"]!.value = new Matrix3(n(0), n(1), n(2), n(3), n(4), n(5), n(6), n(7), n(8));
    if (address === this.shown) return;
    this.shown = address;
    (this.material.uniforms["photo"]!.value as Texture | null)?.dispose();
    this.material.uniforms["photo"]!.value = null;
    if (address === "") return;
    const image = new Image();
    image.onload = () => {
      if (this.shown !== address) return;
      const photo = new Texture(image);
      photo.flipY = false;
      photo.colorSpace = NoColorSpace;
      photo.wrapS = RepeatWrapping;
      photo.minFilter = photo.magFilter = LinearFilter;
      photo.generateMipmaps = false;
      photo.needsUpdate = true;
      this.material.uniforms["photo"]!.value = photo;
      this.onLoad();
    };
    image.onerror = () => {
      if (this.shown === address) this.shown = "";
    };
    image.src = address;
  }

  get ready(): boolean {
    return this.material.uniforms["photo"]!.value !== null;
  }

  get isLoading(): boolean {
    return this.shown !== "" && !this.ready;
  }

  /** Whether it hides all points. */
  get isOpaque(): boolean {
    return this.mesh.visible && this.material.uniforms["opacity"]!.value === 1;
  }

  /** To be called before drawing. `opacity`: 0 = not drawn. */
  place(camera: PerspectiveCamera, opacity: number): void {
    this.mesh.visible = opacity > 0 && this.ready;
    const turn = new Matrix4().extractRotation(camera.matrixWorld);
    this.material.uniforms["rayFromScreen"]!.value = turn.multiply(camera.projectionMatrixInverse);
    this.material.uniforms["opacity"]!.value = opacity;
  }
}
