// SPDX-License-Identifier: BSD-2-Clause
// The points as a picture: loading, views, drawing, picking.
import { type PerspectiveCamera, Scene, WebGLRenderer } from "three";
import { Cameras } from "./cameras";
import { Cloud } from "./cloud";
import type { KeyframeData, ReportData } from "./data";
import { nearestKeyframe, pathOf } from "./trajectory";
import { type Vec3, basisAround, dot, fromCamera, mainDirection, norm, sub } from "./geometry";
import { loadHeld } from "./load";
import { scaleOf } from "./lengths";
import { marksOf } from "./marks";
import { type Picked, type Result, type Scale, type Taken, resultOf } from "./measure";
import { drawOverlay, scaleBar, type Trail } from "./overlay";
import { Pace } from "./pace";
import { hasPhoto, Panorama, photoOf } from "./panorama";
import { pick } from "./pick";
import type { Measurement, Mode, ViewState } from "./state";
import { Stream } from "./stream";
import { type Eyes, pickedFrom } from "./surroundings";
import { Throttle } from "./throttle";

const kPickRadius = 12;

export class Viewer {
  readonly cloud: Cloud;
  readonly renderer: WebGLRenderer;
  readonly basis: readonly [Vec3, Vec3, Vec3];
  readonly cameras: Cameras;
  /** Indices of the existing keyframes in the order of the trajectory. */
  order: number[];
  /** Those of `order` with a depth map; all if there are none. */
  path: number[];
  /** A measurement that is not complete yet. */
  pending: Picked[] = [];
  /** Called when the view changes. */
  onChange: () => void = () => {};
  onLoaded: () => void = () => {};
  /** More points have come, or none will. */
  onStreamed: () => void = () => {};
  /** The view has been set to show all. */
  onFramed: () => void = () => {};
  /** Draws over the points, below the marks. */
  under: ((context: CanvasRenderingContext2D, project: (p: Vec3) => [number, number] | null) => void) | null = null;
  /** Shown as well, at the beginning instead of points. */
  landmarks: readonly Vec3[] = [];
  /** null = the page holds all there is. */
  stream: Stream | null = null;
  readonly scene = new Scene();
  readonly panorama: Panorama;
  private width = 1;
  private height = 1;
  private waiting = false;
  private readonly pace = new Pace();
  private contextLost = false;
  private trail: Trail | null = null;
  /** Whether the user has moved the view. */
  isTouched = false;
  private readonly updateExtentLater = new Throttle(300, () => {
    this.cloud.measureExtent(this.centers(), this.landmarks);
    if (!this.isTouched && this.cloud.loaded + this.landmarks.length > 0) this.setMode(this.state.mode);
    this.redraw();
  });

  constructor(
    readonly data: ReportData,
    readonly canvas: HTMLCanvasElement,
    readonly overlay: HTMLCanvasElement,
    readonly state: ViewState,
  ) {
    this.order = data.keyframes.map((_, i) => i);
    this.path = pathOf(data.keyframes, this.order);
    this.basis = basisAround(data.up, mainDirection(this.centers(), data.up));
    this.cloud = new Cloud(data.nodes, this.basis);
    this.renderer = new WebGLRenderer({ canvas, antialias: false, powerPreference: "high-performance" });
    this.renderer.setClearColor(0x14171a, 1);
    this.renderer.outputColorSpace = "srgb";
    this.panorama = new Panorama(() => this.redraw());
    this.scene.add(this.cloud.group, this.panorama.mesh);
    this.cameras = new Cameras(canvas, state, this.basis, this.cloud, () => this.changed());
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      this.contextLost = true;
    });
    canvas.addEventListener("webglcontextrestored", () => {
      this.contextLost = false;
      this.redraw();
    });
    for (const name of ["pointerdown", "wheel", "keydown"]) {
      canvas.addEventListener(name, () => (this.isTouched = true), { passive: true });
    }
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.isTouched = state.eye !== null;
    this.resize();
  }

  /** Live page only: sets the trajectory and camera centre. */
  setTrajectory(keyframes: KeyframeData[], order: number[], camera: Vec3 | null): void {
    this.data.keyframes = keyframes;
    this.order = order;
    this.path = pathOf(keyframes, order);
    const existing = order.map((i) => keyframes[i]!);
    const marks = existing.map((k) => ({ center: this.centerOf(k), hasPoints: k.use === "depth map" }));
    this.trail = { keyframes: marks, camera };
    this.updateExtentLater.request();
    this.redraw();
  }

  private centers(): Vec3[] {
    return this.order.map((i) => this.centerOf(this.data.keyframes[i]!));
  }

  /** Of a keyframe's camera, from the page's origin. */
  centerOf(keyframe: KeyframeData): Vec3 {
    return sub(keyframe.center, this.data.origin);
  }

  get perspective(): PerspectiveCamera {
    return this.cameras.perspective;
  }

  /** Reads what the page holds; then asks for more where it is served with a Potree folder. */
  async load(): Promise<void> {
    const begin = (): void => {
      this.cloud.measureExtent(this.centers());
      this.setMode(this.state.mode, false);
    };
    const loaded = await loadHeld(this.data.nodes, this.cloud, (cubes) => (cubes === 1 ? begin() : this.redraw()));
    this.cloud.measureExtent(this.centers());
    if (loaded === 0 || !this.state.eye) this.setMode(this.state.mode, false);
    this.redraw();
    this.onLoaded();
    if (!this.data.potree || !location.protocol.startsWith("http")) return;
    this.stream = new Stream(this.cloud, this.data.potree, this.data.origin, () => {
      this.redraw();
      this.onStreamed();
    });
    await this.stream.open();
  }

  private resize(): void {
    if (this.canvas.clientWidth === 0 && this.width > 1) return; // hidden, as while it is printed
    this.width = Math.max(1, this.canvas.clientWidth);
    this.height = Math.max(1, this.canvas.clientHeight);
    this.cameras.resize(this.width, this.height);
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(this.width, this.height, false);
    this.overlay.width = this.width * ratio;
    this.overlay.height = this.height * ratio;
    this.draw();
  }

  /** `fresh`: look from where the mode begins, not from where the address says. */
  setMode(mode: Mode, fresh = true): void {
    const { state, cameras } = this;
    state.mode = mode;
    const eye = fresh ? null : state.eye;
    const target = fresh ? null : state.target;
    cameras.begin(mode);
    if (mode === "orbit") {
      cameras.lookFromOutside(eye, target);
    } else if (mode === "plan") {
      if (fresh && state.clip.join() === "0,1,0,1,0,1") state.clip = [0, 1, 0, 1, 0, this.aboveCameras()];
      cameras.lookFromAbove(eye, target, fresh ? 1 : state.zoom);
    } else {
      state.keyframe = nearestKeyframe(this.data.keyframes, this.order, state.keyframe, mode === "keyframe");
      this.enter(state.keyframe, mode === "keyframe", fresh || !target);
      if (!fresh && target && eye) cameras.lookAlong(sub(target, eye));
    }
    if (fresh) this.onFramed();
    this.changed();
  }

  /** Share of the height up to a little above the cameras: ceilings would hide the rooms. */
  private aboveCameras(): number {
    const up = this.basis[2];
    const heights = this.path.map((i) => dot(this.centerOf(this.data.keyframes[i]!), up)).sort((a, b) => a - b);
    const [low, high] = [this.cloud.low[2], this.cloud.high[2]];
    const top = heights[Math.floor(0.9 * (heights.length - 1))];
    if (top === undefined || !(high > low)) return 1;
    return Math.max(0.05, Math.min(1, (top - low) / (high - low) + 0.08));
  }

  /** Stands where a keyframe's camera stood. `fresh`: looks where it looked. */
  enter(which: number, withPhoto: boolean, fresh: boolean): void {
    const keyframe = this.data.keyframes[which];
    if (!keyframe) return;
    this.state.keyframe = which;
    this.cameras.standAt(this.centerOf(keyframe));
    if (fresh) {
      const next = this.data.keyframes[this.path[this.path.indexOf(which) + 1] ?? which];
      const ahead = next ? sub(next.center, keyframe.center) : ([0, 0, 0] as Vec3);
      this.cameras.lookAlong(withPhoto || norm(ahead) === 0 ? fromCamera(keyframe, [0, 0, 1]) : ahead);
    }
    this.panorama.show(withPhoto ? photoOf(keyframe) : "", keyframe);
    this.changed();
  }

  /** The next or previous keyframe of the trajectory; with a photo where the mode shows them. */
  step(by: number): void {
    let path = this.path;
    if (this.state.mode === "keyframe") {
      const withPhoto = path.filter((i) => hasPhoto(this.data.keyframes[i]));
      if (withPhoto.length > 0) path = withPhoto;
    }
    const at = path.indexOf(this.state.keyframe);
    const next = path[(Math.max(at, 0) + by + path.length) % path.length];
    if (next !== undefined) this.enter(next, this.state.mode === "keyframe", false);
  }

  lookAlong(direction: Vec3): void {
    this.cameras.lookAlong(direction);
  }

  nudge(right: number, up: number, closer: number): void {
    this.cameras.nudge(right, up, closer);
  }

  private changed(): void {
    this.pace.moved();
    this.redraw();
    this.onChange();
  }

  redraw(): void {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.pace.frame(this.cloud);
      this.draw();
      this.pace.settle(this.cloud, () => this.draw());
    });
  }

  /** Draws now. */
  draw(): void {
    if (this.contextLost) return;
    const { state, width, height, cameras } = this;
    const ratio = this.renderer.getPixelRatio();
    cameras.update();
    const camera = cameras.current;
    const focalLength = ratio * cameras.focalLength;
    const outside = this.data.normals !== false && (state.mode === "orbit" || state.mode === "plan");
    this.cloud.setLook(state.coloring, state.size, state.clip, outside);
    this.cloud.choose(camera, focalLength, ratio);
    this.panorama.place(this.perspective, state.mode === "keyframe" ? 1 - state.fade : 0);
    this.renderer.render(this.scene, camera);
    this.stream?.look(camera, focalLength);
    const context = this.overlay.getContext("2d");
    if (!context) return;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, this.overlay.width, this.overlay.height);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.under?.(context, (p) => this.project(p));
    const scale = state.mode === "plan" ? scaleBar(cameras.focalLength, this.scale) : null;
    drawOverlay(context, width, height, ratio, (p) => this.project(p), marksOf(state, this.pending, this.basis[2], (it) => this.result(it).text), scale, this.trail);
  }

  /** Pixels from the upper left corner; null where it is behind. */
  project(position: Vec3): [number, number] | null {
    return this.cameras.project(position);
  }

  /** The point at pixels from the upper left corner of the picture. */
  pick(x: number, y: number): Taken | null {
    const { width, height } = this;
    const camera = this.cameras.current;
    camera.updateMatrixWorld();
    const found = pick(this.cloud, camera, x, y, width, height, kPickRadius);
    return found && pickedFrom(this.cloud, camera, found, (2 * x) / width - 1, 1 - (2 * y) / height, this.eyes);
  }

  get eyes(): Eyes {
    const { keyframes, pixel } = this.data;
    return { pixel, reach: this.cameras.extent / 2, camera: (i) => (keyframes[i] ? this.centerOf(keyframes[i]) : null) };
  }

  /** Unit that lengths are shown in. */
  get scale(): Scale {
    return scaleOf(this.data.unit, this.state.calibration, this.state.unit, { up: this.basis[2], ...this.eyes });
  }

  /** What a measurement says. */
  result(it: Measurement): Result {
    return resultOf(it, { up: this.basis[2], scale: this.scale, ...this.eyes });
  }

  /** The picture with all that is drawn over it. */
  picture(): HTMLCanvasElement {
    this.draw();
    const copy = document.createElement("canvas");
    copy.width = this.canvas.width;
    copy.height = this.canvas.height;
    const context = copy.getContext("2d");
    context?.drawImage(this.canvas, 0, 0);
    context?.drawImage(this.overlay, 0, 0, copy.width, copy.height);
    return copy;
  }
}
