// SPDX-License-Identifier: BSD-2-Clause
// Cameras of the four views, and what moves them.
import { type Camera, OrthographicCamera, PerspectiveCamera, Vector3 } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { planHalf, seenOf } from "./framing";
import { type Vec3, add, cross, dot, norm, sub, times, unit } from "./geometry";
import { listenForLooking, nudgeOrbit } from "./navigate";
import type { Mode, ViewState } from "./state";

const kFov = 60;
/** Of the frame, the share that the first view fills. */
const kFilled = 0.85;
/** From where the first view looks, along the basis: across the longer walls, from above. */
const kFirstView: Vec3 = [-0.3, -0.8, 0.75];

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
    for (const controls of [this.orbit, this.plan]) {
      controls.zoomToCursor = true;
      controls.addEventListener("change", () => this.moved());
    }
    this.plan.mouseButtons.LEFT = 2; // pans
    this.plan.touches.ONE = 1;
    listenForLooking(canvas, {
      isFree: () => state.mode === "walk" || state.mode === "keyframe",
      perPixel: () => ((this.perspective.fov / this.height) * Math.PI) / 180,
      turn: (yaw, pitch) => this.turn(yaw, pitch),
      zoom: (by, x, y) => this.zoomFov(by, x, y),
    });
  }

  get current(): PerspectiveCamera | OrthographicCamera {
    return this.state.mode === "plan" ? this.flat : this.perspective;
  }

  /** Size of the picture [px]. */
  resize(width: number, height: number): void {
    [this.width, this.height] = [width, height];
  }

  get eye(): Vec3 {
    return this.current.position.toArray() as [number, number, number];
  }

  /** From the eye to the pivot of the view from outside. */
  get pivotDistance(): number {
    return this.perspective.position.distanceTo(this.orbit.target);
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

  private alongBasis(v: Vec3): Vec3 {
    return this.basis.reduce((sum, axis, i) => add(sum, times(axis, v[i as 0])), [0, 0, 0] as Vec3);
  }

  /** Looks from outside. */
  lookFromOutside(eye: Vec3, target: Vec3): void {
    this.perspective.position.set(...eye);
    this.orbit.target.set(...target);
    this.orbit.update();
  }

  /** Looks from outside so that places fill the frame. `placesFor`: what a camera may see of the cloud. */
  lookAtAll(placesFor: (camera: Camera) => Vec3[]): void {
    const off = times(this.alongBasis(kFirstView), 1 / norm(kFirstView));
    let target = this.corner([0.5, 0.5, 0.5]);
    let distance = this.extent;
    let places: Vec3[] | null = null;
    for (let round = 0; round < 12; ++round) {
      this.perspective.position.set(...add(target, times(off, distance)));
      this.perspective.lookAt(...target);
      this.update();
      places ??= placesFor(this.perspective);
      const seen = places.flatMap((p) => {
        const at = this.project(p);
        return at ? [[(2 * at[0]) / this.width - 1, 1 - (2 * at[1]) / this.height] as const] : [];
      });
      if (seen.length < 0.9 * places.length || seen.length === 0) {
        distance *= 2;
        continue;
      }
      const { middle, half } = seenOf(seen);
      const tall = distance * Math.tan((kFov * Math.PI) / 360);
      const e = this.perspective.matrixWorld.elements;
      const [right, up]: [Vec3, Vec3] = [[e[0], e[1], e[2]], [e[4], e[5], e[6]]];
      target = add(target, add(times(right, (middle[0] * tall * this.width) / this.height), times(up, middle[1] * tall)));
      distance *= half / kFilled;
    }
    this.lookFromOutside(add(target, times(off, distance)), target);
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

  /** Shows the whole plan, its bounds `share` of the picture, while `act` runs; returns what it does. */
  withWholePlan<T>(share: number, act: () => T): T {
    const { zoom } = this.flat;
    const { eye, target } = this;
    // planHalf leaves a margin around the bounds.
    this.lookFromAbove(null, null, share / kFilled);
    const made = act();
    this.lookFromAbove(eye, target, zoom);
    return made;
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
      this.shift(add(times(this.basis[0], right * step), times(this.basis[1], up * step)));
    } else if (mode === "orbit") {
      nudgeOrbit(this.perspective, this.orbit.target, this.basis[2], right, up, closer);
      this.orbit.update();
    } else {
      this.turn(-0.12 * right, 0.1 * up);
      this.zoomFov(-6 * closer);
    }
    this.moved();
  }

  /** `x` and `y`: of what stays where it is [px]. */
  private zoomFov(by: number, x = this.width / 2, y = this.height / 2): void {
    const before = this.anglesAt(x, y);
    this.perspective.fov = Math.max(15, Math.min(100, this.perspective.fov + by));
    const after = this.anglesAt(x, y);
    this.turn(after[0] - before[0], after[1] - before[1]);
  }

  /** To the right of and below the middle of the picture [rad]. */
  private anglesAt(x: number, y: number): [number, number] {
    const focal = this.height / (2 * Math.tan((this.perspective.fov * Math.PI) / 360));
    return [Math.atan((x - this.width / 2) / focal), Math.atan((y - this.height / 2) / focal)];
  }

  /** Moves by shares of the extent: right, ahead and up. */
  walk([right, ahead, up]: Vec3): void {
    const { mode } = this.state;
    const scale = mode === "plan" ? this.extent / this.flat.zoom : mode === "orbit" ? Math.max(this.pivotDistance, 0.1 * this.extent) : this.extent;
    this.translate(times(add(this.directionOf(right, ahead), times(this.basis[2], mode === "plan" ? 0 : up)), scale));
  }

  /** Horizontally, as seen in the picture. */
  directionOf(right: number, ahead: number): Vec3 {
    const along = this.current.getWorldDirection(new Vector3()).toArray() as [number, number, number];
    const flat = sub(along, times(this.basis[2], dot(along, this.basis[2])));
    const forward = this.state.mode === "plan" ? this.basis[1] : unit(flat);
    return add(times(cross(forward, this.basis[2]), right), times(forward, ahead));
  }

  /** Moves a view from outside. */
  shift(by: Vec3): void {
    if (this.controls) this.translate(by);
  }

  private translate(by: Vec3): void {
    const step = new Vector3(...by);
    this.current.position.add(step);
    this.controls?.target.add(step);
    this.controls?.update();
    this.moved();
  }

  /** What a view from outside looks at; null in other views. */
  get target(): Vec3 | null {
    const controls = this.controls;
    return controls && (controls.target.toArray() as [number, number, number]);
  }

  private get controls(): OrbitControls | null {
    const { mode } = this.state;
    return mode === "plan" ? this.plan : mode === "orbit" ? this.orbit : null;
  }

  /** From outside turns towards a place and around it; in the plan brings it into the middle. */
  setPivot(place: Vec3): void {
    if (this.state.mode === "plan") {
      this.center(place);
      return;
    }
    this.orbit.target.set(...place);
    this.orbit.update();
    this.moved();
  }

  /** Brings a place into the middle without turning. */
  center(place: Vec3): void {
    if (this.target) this.shift(sub(place, this.target));
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

  /** `margin`: to the rim [px]. */
  isInPicture(place: Vec3, margin: number): boolean {
    const at = this.project(place);
    return at !== null && at[0] > margin && at[0] < this.width - margin && at[1] > margin && at[1] < this.height - margin;
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
