// SPDX-License-Identifier: BSD-2-Clause
// Cameras of the four views, and what moves them.
import { OrthographicCamera, PerspectiveCamera, Vector3 } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { planHalf, viewDistance } from "./framing";
import { type Vec3, add, dot, norm, sub, times } from "./geometry";
import { listenForLooking, nudgeOrbit } from "./navigate";
import type { Mode, ViewState } from "./state";

const kFov = 60;

/** What a view shows: bounds along the basis, as Cloud has them. */
export interface Bounds {
  low: Vec3;
  high: Vec3;
}

export class Cameras {
  readonly perspective = new PerspectiveCamera(kFov, 1, 0.01, 1000);
  readonly flat = new OrthographicCamera(-1, 1, 1, -1, -1000, 1000);
  private readonly orbit: OrbitControls;
  private readonly plan: OrbitControls;
  private width = 1;
  private height = 1;
  private yaw = 0;
  private pitch = 0;

  /** `changed`: called when a camera moves. */
  constructor(
    canvas: HTMLCanvasElement,
    private readonly state: ViewState,
    private readonly basis: readonly [Vec3, Vec3, Vec3],
    private readonly bounds: Bounds,
    private readonly changed: () => void,
  ) {
    this.perspective.up.set(...basis[2]);
    this.flat.up.set(...basis[1]);
    this.orbit = new OrbitControls(this.perspective, canvas);
    this.plan = new OrbitControls(this.flat, canvas);
    this.plan.enableRotate = false;
    this.plan.screenSpacePanning = true;
    for (const controls of [this.orbit, this.plan]) controls.addEventListener("change", () => this.moved());
    this.plan.mouseButtons.LEFT = 2; // pans
    this.plan.touches.ONE = 1;
    listenForLooking(canvas, {
      isFree: () => state.mode === "walk" || state.mode === "keyframe",
      perPixel: () => ((this.perspective.fov / this.height) * Math.PI) / 180,
      turn: (yaw, pitch) => this.turn(yaw, pitch),
      zoom: (by) => this.zoomFov(by),
    });
  }

  get current(): PerspectiveCamera | OrthographicCamera {
    return this.state.mode === "plan" ? this.flat : this.perspective;
  }

  /** Size of the picture [px]. */
  resize(width: number, height: number): void {
    [this.width, this.height] = [width, height];
  }

  private corner(share: Vec3): Vec3 {
    const { low, high } = this.bounds;
    return this.basis.reduce(
      (sum, axis, i) => add(sum, times(axis, (low[i] ?? 0) + (share[i] ?? 0) * ((high[i] ?? 0) - (low[i] ?? 0)))),
      [0, 0, 0] as Vec3,
    );
  }

  get extent(): number {
    return Math.max(norm(sub(this.bounds.high, this.bounds.low)), 1e-6);
  }

  /** Sets near, far and field of view for a view. */
  begin(mode: Mode): void {
    [this.orbit.enabled, this.plan.enabled] = [mode === "orbit", mode === "plan"];
    this.perspective.near = this.extent * 2e-4;
    this.perspective.far = this.extent * 100;
    this.perspective.fov = kFov;
  }

  /** Looks from outside. null = where the view begins. */
  lookFromOutside(eye: Vec3 | null, target: Vec3 | null): void {
    const center = this.corner([0.5, 0.5, 0.5]);
    const off = sub(this.corner([0.1, -0.25, 2.2]), center);
    const away = times(off, viewDistance(this.extent, this.width / this.height) / norm(off));
    this.perspective.position.set(...(eye ?? add(center, away)));
    this.orbit.target.set(...(target ?? center));
    this.orbit.update();
  }

  /** Looks from above. null = where the view begins. */
  lookFromAbove(eye: Vec3 | null, target: Vec3 | null, zoom: number): void {
    const center = this.corner([0.5, 0.5, 0.5]);
    this.flat.position.set(...(eye ?? add(center, times(this.basis[2], this.extent))));
    this.plan.target.set(...(target ?? center));
    this.flat.near = -100 * this.extent;
    this.flat.far = 100 * this.extent;
    this.flat.zoom = zoom;
    this.plan.update();
  }

  /** What a view from outside looks at; null in other views. */
  get target(): Vec3 | null {
    const { mode } = this.state;
    const controls = mode === "plan" ? this.plan : mode === "orbit" ? this.orbit : null;
    return controls && (controls.target.toArray() as [number, number, number]);
  }

  /** Moves a view from outside. */
  shift(by: Vec3): void {
    if (!this.target) return;
    const controls = this.state.mode === "plan" ? this.plan : this.orbit;
    const step = new Vector3(...by);
    this.current.position.add(step);
    controls.target.add(step);
    controls.update();
    this.moved();
  }

  /** Moves the eye without turning it. */
  standAt(place: Vec3): void {
    this.perspective.position.set(...place);
    this.look();
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
    this.moved();
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
    this.moved();
  }

  private zoomFov(by: number): void {
    this.perspective.fov = Math.max(15, Math.min(100, this.perspective.fov + by));
    this.moved();
  }

  private moved(): void {
    const { state } = this;
    const { mode } = state;
    const camera = this.current;
    const eye = camera.position.toArray() as [number, number, number];
    const target =
      mode === "orbit" ? this.orbit.target : mode === "plan" ? this.plan.target : camera.getWorldDirection(new Vector3()).add(camera.position);
    state.eye = eye;
    state.target = target.toArray() as [number, number, number];
    state.zoom = mode === "plan" ? this.flat.zoom : 1;
    this.changed();
  }

  /** Half of the height that the plan shows at zoom 1. */
  private get half(): number {
    return planHalf(this.bounds.low, this.bounds.high, this.width / this.height);
  }

  /** Brings the matrices up to date; to be called before drawing. */
  update(): void {
    const aspect = this.width / this.height;
    const { half } = this;
    this.perspective.aspect = aspect;
    this.flat.left = -half * aspect;
    this.flat.right = half * aspect;
    this.flat.top = half;
    this.flat.bottom = -half;
    this.perspective.updateProjectionMatrix();
    this.flat.updateProjectionMatrix();
    this.current.updateMatrixWorld();
  }

  /** Of a unit at distance 1, or of a unit of the plan [px of the page]. */
  get focalLength(): number {
    return this.state.mode === "plan"
      ? (this.height * this.flat.zoom) / (2 * this.half)
      : this.height / (2 * Math.tan((this.perspective.fov * Math.PI) / 360));
  }

  /** Pixels from the upper left corner; null where it is behind. */
  project(position: Vec3): [number, number] | null {
    const { current } = this;
    const at = new Vector3(...position).applyMatrix4(current.matrixWorldInverse);
    if (current === this.perspective && at.z > -this.perspective.near) return null;
    at.applyMatrix4(current.projectionMatrix);
    return [((at.x + 1) * this.width) / 2, ((1 - at.y) * this.height) / 2];
  }
}
