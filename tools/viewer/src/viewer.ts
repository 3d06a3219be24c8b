// SPDX-License-Identifier: BSD-2-Clause
// Renderer: cameras, controls, drawing, picking.
import { OrthographicCamera, PerspectiveCamera, Scene, Vector3, WebGLRenderer } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { Cloud } from "./cloud";
import { type KeyframeData, type ReportData, imageAddress } from "./data";
import { nearestKeyframe, pathOf } from "./trajectory";
import { planHalf, viewDistance } from "./framing";
import { type Vec3, add, basisAround, dot, fromCamera, mainDirection, norm, sub, times } from "./geometry";
import { loadHeld } from "./load";
import { type Picked, type Result, resultOf } from "./measure";
import { listenForLooking, nudgeOrbit } from "./navigate";
import { drawOverlay, type Mark, scaleBar, type Trail } from "./overlay";
import { Pace } from "./pace";
import { Panorama } from "./panorama";
import type { Measurement, Mode, ViewState } from "./state";
import { Stream } from "./stream";
import { type Eyes, pickedFrom } from "./surroundings";
import { Throttle } from "./throttle";

const kFov = 60;
const kPickRadius = 12;

export class Viewer {
  readonly cloud: Cloud;
  readonly renderer: WebGLRenderer;
  readonly basis: readonly [Vec3, Vec3, Vec3];
  readonly perspective = new PerspectiveCamera(kFov, 1, 0.01, 1000);
  readonly flat = new OrthographicCamera(-1, 1, 1, -1, -1000, 1000);
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
  /** null = the page holds all there is. */
  stream: Stream | null = null;
  private readonly scene = new Scene();
  private readonly panorama: Panorama;
  private readonly orbit: OrbitControls;
  private readonly plan: OrbitControls;
  private width = 1;
  private height = 1;
  private waiting = false;
  private readonly pace = new Pace();
  private yaw = 0;
  private pitch = 0;
  private contextLost = false;
  private trail: Trail | null = null;
  /** Whether the user has moved the view. */
  private touched = false;
  private readonly updateExtentLater = new Throttle(300, () => {
    this.cloud.measureExtent(this.centers());
    if (!this.touched && this.cloud.loaded > 0) this.setMode(this.state.mode);
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
    this.perspective.up.set(...this.basis[2]);
    this.flat.up.set(...this.basis[1]);
    this.orbit = new OrbitControls(this.perspective, canvas);
    this.plan = new OrbitControls(this.flat, canvas);
    this.plan.enableRotate = false;
    this.plan.screenSpacePanning = true;
    for (const controls of [this.orbit, this.plan]) controls.addEventListener("change", () => this.changed());
    this.plan.mouseButtons.LEFT = 2; // pans
    this.plan.touches.ONE = 1;
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      this.contextLost = true;
    });
    canvas.addEventListener("webglcontextrestored", () => {
      this.contextLost = false;
      this.redraw();
    });
    listenForLooking(canvas, {
      isFree: () => this.state.mode === "walk" || this.state.mode === "keyframe",
      perPixel: () => ((this.perspective.fov / this.height) * Math.PI) / 180,
      turn: (yaw, pitch) => this.turn(yaw, pitch),
      zoom: (by) => this.zoomFov(by),
    });
    for (const name of ["pointerdown", "wheel", "keydown"]) {
      canvas.addEventListener(name, () => (this.touched = true), { passive: true });
    }
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.touched = state.eye !== null;
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

  get camera(): PerspectiveCamera | OrthographicCamera {
    return this.state.mode === "plan" ? this.flat : this.perspective;
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
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(this.width, this.height, false);
    this.overlay.width = this.width * ratio;
    this.overlay.height = this.height * ratio;
    this.draw();
  }

  private corner(share: Vec3): Vec3 {
    const { low, high } = this.cloud;
    return this.basis.reduce(
      (sum, axis, i) => add(sum, times(axis, (low[i] ?? 0) + (share[i] ?? 0) * ((high[i] ?? 0) - (low[i] ?? 0)))),
      [0, 0, 0] as Vec3,
    );
  }

  private get extent(): number {
    return Math.max(norm(sub(this.cloud.high, this.cloud.low)), 1e-6);
  }

  /** `fresh`: look from where the mode begins, not from where the address says. */
  setMode(mode: Mode, fresh = true): void {
    const state = this.state;
    state.mode = mode;
    [this.orbit.enabled, this.plan.enabled] = [mode === "orbit", mode === "plan"];
    const eye = fresh ? null : state.eye;
    const target = fresh ? null : state.target;
    this.perspective.near = this.extent * 2e-4;
    this.perspective.far = this.extent * 100;
    this.perspective.fov = kFov;
    const center = this.corner([0.5, 0.5, 0.5]);
    if (mode === "orbit") {
      const off = sub(this.corner([0.1, -0.25, 2.2]), center);
      const away = times(off, viewDistance(this.extent, this.width / this.height) / norm(off));
      this.perspective.position.set(...(eye ?? add(center, away)));
      this.orbit.target.set(...(target ?? center));
      this.orbit.update();
    } else if (mode === "plan") {
      if (fresh && state.clip.join() === "0,1,0,1,0,1") state.clip = [0, 1, 0, 1, 0, this.aboveCameras()];
      this.flat.position.set(...(eye ?? add(center, times(this.basis[2], this.extent))));
      this.plan.target.set(...(target ?? center));
      this.flat.near = -100 * this.extent;
      this.flat.far = 100 * this.extent;
      this.flat.zoom = fresh ? 1 : state.zoom;
      this.plan.update();
    } else {
      state.keyframe = nearestKeyframe(this.data.keyframes, this.order, state.keyframe, mode === "keyframe");
      this.enter(state.keyframe, mode === "keyframe", fresh || !target);
      if (!fresh && target && eye) this.lookAlong(sub(target, eye));
    }
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
    this.perspective.position.set(...this.centerOf(keyframe));
    if (fresh) {
      const next = this.data.keyframes[this.path[this.path.indexOf(which) + 1] ?? which];
      const ahead = next ? sub(next.center, keyframe.center) : ([0, 0, 0] as Vec3);
      this.lookAlong(withPhoto || norm(ahead) === 0 ? fromCamera(keyframe, [0, 0, 1]) : ahead);
    } else {
      this.look();
    }
    this.panorama.show(withPhoto && keyframe.panorama ? imageAddress(document, keyframe.panorama) : "", keyframe);
    this.changed();
  }

  /** The next or previous keyframe of the trajectory; with a photo where the mode shows them. */
  step(by: number): void {
    let path = this.path;
    if (this.state.mode === "keyframe") {
      const withPhoto = path.filter((i) => this.data.keyframes[i]?.panorama);
      if (withPhoto.length > 0) path = withPhoto;
    }
    const at = path.indexOf(this.state.keyframe);
    const next = path[(Math.max(at, 0) + by + path.length) % path.length];
    if (next !== undefined) this.enter(next, this.state.mode === "keyframe", false);
  }

  lookAlong(direction: Vec3): void {
    const [a, b, c] = this.basis;
    this.yaw = Math.atan2(dot(direction, b), dot(direction, a));
    this.pitch = Math.atan2(dot(direction, c), Math.hypot(dot(direction, a), dot(direction, b)));
    this.look();
  }

  turn(yaw: number, pitch: number): void {
    this.yaw += yaw;
    this.pitch += pitch;
    this.look();
  }

  private look(): void {
    this.pitch = Math.max(-1.5, Math.min(1.5, this.pitch));
    const [a, b, c] = this.basis;
    const flat = add(times(a, Math.cos(this.yaw)), times(b, Math.sin(this.yaw)));
    const ahead = add(times(flat, Math.cos(this.pitch)), times(c, Math.sin(this.pitch)));
    this.perspective.lookAt(this.perspective.position.clone().add(new Vector3(...ahead)));
    this.changed();
  }

  /** Arrow keys and buttons, in all modes. */
  nudge(right: number, up: number, closer: number): void {
    const { mode } = this.state;
    if (mode === "plan") {
      this.flat.zoom = Math.max(0.01, Math.min(1000, this.flat.zoom * 1.25 ** closer));
      const step = (0.1 * this.extent) / this.flat.zoom;
      const by = new Vector3(...add(times(this.basis[0], right * step), times(this.basis[1], up * step)));
      this.flat.position.add(by);
      this.plan.target.add(by);
      this.plan.update();
    } else if (mode === "orbit") {
      nudgeOrbit(this.perspective, this.orbit.target, this.basis[2], right, up, closer);
      this.orbit.update();
    } else {
      this.turn(-0.12 * right, 0.1 * up);
      this.zoomFov(-6 * closer);
    }
    this.changed();
  }

  private zoomFov(by: number): void {
    this.perspective.fov = Math.max(15, Math.min(100, this.perspective.fov + by));
    this.changed();
  }

  private changed(): void {
    const { state } = this;
    const { mode } = state;
    const { camera } = this;
    const eye = camera.position.toArray() as [number, number, number];
    const target =
      mode === "orbit" ? this.orbit.target : mode === "plan" ? this.plan.target : camera.getWorldDirection(new Vector3()).add(camera.position);
    state.eye = eye;
    state.target = target.toArray() as [number, number, number];
    state.zoom = mode === "plan" ? this.flat.zoom : 1;
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
    const { state, width, height } = this;
    const ratio = this.renderer.getPixelRatio();
    const aspect = width / height;
    this.perspective.aspect = aspect;
    this.perspective.updateProjectionMatrix();
    const half = planHalf(this.cloud.low, this.cloud.high, aspect);
    this.flat.left = -half * aspect;
    this.flat.right = half * aspect;
    this.flat.top = half;
    this.flat.bottom = -half;
    this.flat.updateProjectionMatrix();
    const camera = this.camera;
    camera.updateMatrixWorld();
    const focalLength =
      camera === this.flat
        ? (ratio * height * this.flat.zoom) / (2 * half)
        : (ratio * height) / (2 * Math.tan((this.perspective.fov * Math.PI) / 360));
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
    const perUnit = state.mode === "plan" ? (height * this.flat.zoom) / (2 * half) : 0;
    const scale = perUnit > 0 ? scaleBar(perUnit, this.data.unit) : null;
    drawOverlay(context, width, height, ratio, (p) => this.project(p), this.marks(), scale, this.trail);
  }

  /** Pixels from the upper left corner; null where it is behind. */
  project(position: Vec3): [number, number] | null {
    const at = new Vector3(...position).applyMatrix4(this.camera.matrixWorldInverse);
    if (this.camera === this.perspective && at.z > -this.perspective.near) return null;
    at.applyMatrix4(this.camera.projectionMatrix);
    return [((at.x + 1) * this.width) / 2, ((1 - at.y) * this.height) / 2];
  }

  /** The point at pixels from the upper left corner of the picture. */
  pick(x: number, y: number): Picked | null {
    const { camera, width, height } = this;
    camera.updateMatrixWorld();
    const found = this.cloud.pick(camera, x, y, width, height, kPickRadius);
    return found && pickedFrom(this.cloud, camera, found, (2 * x) / width - 1, 1 - (2 * y) / height, this.eyes);
  }

  private get eyes(): Eyes {
    const { keyframes, pixel } = this.data;
    return { pixel, reach: this.extent / 2, camera: (i) => (keyframes[i] ? this.centerOf(keyframes[i]) : null) };
  }

  /** What a measurement says. */
  result(it: Measurement): Result {
    return resultOf(it, { up: this.basis[2], unit: this.data.unit, ...this.eyes });
  }

  private marks(): Mark[] {
    const marks: Mark[] = this.state.measurements.map((it) => ({
      points: it.points.map((p) => p.position),
      closed: it.kind === "area",
      text: this.result(it).text,
    }));
    if (this.pending.length > 0) marks.push({ points: this.pending.map((p) => p.position), closed: false, text: "" });
    for (const note of this.state.notes) marks.push({ points: [note.position], closed: false, text: note.text });
    return marks;
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
