// SPDX-License-Identifier: BSD-2-Clause
// The points as a picture: loading, views, drawing, picking.
import type { Camera, PerspectiveCamera, WebGLRenderTarget, WebGLRenderer } from "three";
import { Cameras } from "./cameras";
import { Cloud, type Cube } from "./cloud";
import { type Cut, cutFromShares, isSameCut, noCut, planCut } from "./cuts";
import type { KeyframeData, ReportData } from "./data";
import { straightBasis } from "./framing";
import { type Vec3, dot, fromCamera, mainDirection, norm, sub } from "./geometry";
import { Frames } from "./frames";
import { loadHeld, rootNormals } from "./load";
import { scaleOf } from "./lengths";
import { type Picked, type Result, type Scale, type Taken, resultOf } from "./measure";
import { Overlay } from "./overlay";
import type { Position } from "./minimap";
import { Walking } from "./navigate";
import { Panorama, photoOf } from "./panorama";
import { kPickRadius, pick } from "./pick";
import { Picture } from "./picture";
import type { Measurement, Mode, ViewState } from "./state";
import type { Storey } from "./storeys";
import { Stream } from "./stream";
import { type Eyes, pickedFrom } from "./surroundings";
import { Throttle } from "./throttle";
import { isOutside, Tour } from "./tour";
import { nearestKeyframe, Trajectory } from "./trajectory";

export class Viewer {
  readonly cloud: Cloud;
  readonly basis: readonly [Vec3, Vec3, Vec3];
  readonly cameras: Cameras;
  readonly trajectory: Trajectory;
  /** A measurement that is not complete yet. */
  pending: Picked[] = [];
  /** Called when the view changes. */
  onChange: () => void = () => {};
  onLoaded: () => void = () => {};
  /** The bounds of the cloud were measured. */
  onExtent: () => void = () => {};
  /** More points have come, or none will. */
  onStreamed: () => void = () => {};
  /** The view has been set to show all. */
  onFramed: () => void = () => {};
  /** Shown as well, at the beginning instead of points. */
  landmarks: readonly Vec3[] = [];
  /** null = the page holds all there is. */
  stream: Stream | null = null;
  readonly overlay: Overlay;
  readonly frames: Frames;
  readonly tour: Tour;
  private readonly walking: Walking;
  private readonly drawing: Picture;
  readonly panorama: Panorama;
  private width = 1;
  private height = 1;
  /** That the plan made, not the user. */
  private cutOfPlan = noCut();
  private isLoaded = false;
  /** Whether the user has moved the view. */
  isTouched = false;
  private readonly updateExtentLater = new Throttle(300, () => {
    this.measureExtent();
    if (!this.isTouched && this.cloud.loaded + this.landmarks.length > 0) this.setMode(this.state.mode);
    this.pointsChanged();
    this.drawOver();
  });

  constructor(
    readonly data: ReportData,
    readonly canvas: HTMLCanvasElement,
    overlay: HTMLCanvasElement,
    readonly state: ViewState,
  ) {
    this.trajectory = new Trajectory(data);
    const path = mainDirection(this.trajectory.centers, data.up);
    this.basis = straightBasis(data.up, path, state.isAlongPath ? [] : rootNormals(data.nodes));
    this.cloud = new Cloud(data.nodes, this.basis, data.normals !== false);
    this.panorama = new Panorama(() => this.redraw());
    this.cameras = new Cameras(canvas, state, this.basis, this.cloud, () => this.changed());
    this.overlay = new Overlay(overlay, this);
    this.drawing = new Picture(canvas, this.cloud.group, this.panorama.mesh, () => this.redraw());
    this.frames = new Frames({
      begin: (budget) => this.begin(budget),
      add: (cubes) => this.add(cubes),
      present: () => this.present(),
      completed: () => setTimeout(() => this.isLoaded && this.overlay.measureMiddle()),
      whenFinished: (done) => this.drawing.whenFinished(done),
    });
    this.frames.listen(canvas);
    this.tour = new Tour(this.cameras, state, {
      places: () => this.trajectory.places,
      path: (mode) => this.trajectory.pathIn(mode),
      enter: (which) => this.enter(which, state.mode === "keyframe", false),
      prepare: (which) => this.showPhoto(which),
      marked: () => {
        this.overlay.isStepped = true;
        this.changed();
      },
    });
    this.walking = new Walking(canvas, (by) => this.tour.walk(by));
    for (const name of ["pointerdown", "wheel", "keydown"]) {
      canvas.addEventListener(name, () => (this.isTouched = true), { passive: true });
    }
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.isTouched = state.eye !== null;
    this.resize();
  }

  /** Live page only: sets the trajectory and camera centre. */
  setTrajectory(keyframes: KeyframeData[], order: number[], camera: Vec3 | null): void {
    this.trajectory.set(keyframes, order, camera);
    this.updateExtentLater.request();
    this.pointsChanged();
  }

  get perspective(): PerspectiveCamera {
    return this.cameras.perspective;
  }

  /** Reads what the page holds; then asks for more where it is served with a Potree folder. */
  async load(): Promise<void> {
    const begin = (): void => {
      this.measureExtent();
      this.setMode(this.state.mode, false);
    };
    const loaded = await loadHeld(this.data.nodes, this.cloud, (cubes) => (cubes === 1 ? begin() : this.pointsChanged()));
    this.measureExtent();
    this.state.clip = null;
    this.isLoaded = true;
    if (loaded === 0 || !this.isTouched) this.setMode(this.state.mode, !this.isTouched);
    this.pointsChanged();
    this.onLoaded();
    if (!this.data.potree || !location.protocol.startsWith("http")) return;
    this.stream = new Stream(this.cloud, this.data.potree, this.data.origin, () => {
      this.pointsChanged();
      this.onStreamed();
    });
    await this.stream.open();
  }

  /** Bounds of the cloud, its storeys, and the cut of an old address, which counts in shares of the bounds. */
  private measureExtent(): void {
    const { cloud, state } = this;
    cloud.measureExtent(this.trajectory.centers, this.landmarks);
    this.trajectory.measureStoreys(cloud, this.data.normals !== false);
    if (state.clip) state.cut = cutFromShares(state.clip, cloud.low, cloud.high);
    this.onExtent();
  }

  /** For the small plan; null in views from outside. */
  get position(): Position | null {
    const { cameras, state } = this;
    if (isOutside(state.mode)) return null;
    return { eye: cameras.eye, direction: cameras.directionOf(0, 1), places: this.trajectory.places };
  }

  /** Heights that a plan of the current storey shows. */
  get planHeights(): [number, number] {
    const cut = this.automaticCut;
    return [cut[4] ?? Number.NEGATIVE_INFINITY, cut[5] ?? Number.POSITIVE_INFINITY];
  }

  /** The storey of the current keyframe. */
  get storey(): Storey {
    return this.trajectory.storeyOf(this.state.keyframe);
  }

  private get automaticCut(): Cut {
    return planCut(this.storey, this.storey === this.trajectory.storeys[0]);
  }

  private resize(): void {
    if (this.canvas.clientWidth === 0 && this.width > 1) return; // hidden, as while it is printed
    this.setSize(this.canvas.clientWidth, this.canvas.clientHeight);
    this.frames.drawFew();
    this.frames.moved();
  }

  private setSize(width: number, height: number): void {
    this.width = Math.max(1, width);
    this.height = Math.max(1, height);
    this.cameras.resize(this.width, this.height);
    this.drawing.resize(this.width, this.height);
    this.overlay.resize(this.canvas.width, this.canvas.height);
  }

  /** `fresh`: look from where the mode begins, not from where the address says. */
  setMode(mode: Mode, fresh = true): void {
    const { state, cameras } = this;
    if (state.clip && this.isLoaded) {
      this.measureExtent();
      state.clip = null;
    }
    const isAutomatic = isSameCut(state.cut, this.cutOfPlan) || isSameCut(state.cut, this.automaticCut);
    if (isAutomatic && (mode !== "plan" || fresh)) state.cut = noCut();
    state.mode = mode;
    const eye = fresh ? null : state.eye;
    const target = fresh ? null : state.target;
    cameras.begin(mode);
    this.tour.stop();
    this.overlay.forget();
    if (mode === "orbit") {
      if (eye && target) cameras.lookFromOutside(eye, target);
      else cameras.lookAtAll((camera) => this.placesToShow(camera));
    } else if (mode === "plan") {
      if (fresh && isSameCut(state.cut, noCut()) && this.cloud.loaded > 0) state.cut = this.cutOfPlan = this.automaticCut;
      cameras.lookFromAbove(eye, target, fresh ? 1 : state.zoom);
    } else {
      state.keyframe = nearestKeyframe(this.data.keyframes, this.trajectory.order, state.keyframe, mode === "keyframe");
      this.enter(state.keyframe, mode === "keyframe", fresh || !target);
      if (eye && target) {
        if (mode === "walk") cameras.standAt(eye);
        cameras.lookAlong(sub(target, eye));
      }
    }
    if (fresh) this.onFramed();
    this.changed();
  }

  /** Points within the bounds that a camera may see, and the path. */
  private placesToShow(camera: Camera): Vec3[] {
    const { cloud, state, basis } = this;
    cloud.setLook(state.coloring, state.size, state.cut, this.isSeenThrough);
    const places = [...this.trajectory.centers, ...this.landmarks];
    cloud.forEachShown(camera, Math.max(1, Math.floor(cloud.loaded / 5000)), (at) => {
      if (basis.every((axis, i) => dot(axis, at) >= cloud.low[i as 0] && dot(axis, at) <= cloud.high[i as 0])) places.push(at);
    });
    return places;
  }

  /** Whether surfaces seen from behind are left out. */
  private get isSeenThrough(): boolean {
    return this.data.normals !== false && isOutside(this.state.mode);
  }

  /** Stands where a keyframe's camera stood. `fresh`: looks where it looked. */
  enter(which: number, withPhoto: boolean, fresh: boolean): void {
    const keyframe = this.data.keyframes[which];
    if (!keyframe) return;
    this.state.keyframe = which;
    this.cameras.standAt(this.trajectory.centerOf(keyframe));
    if (fresh) {
      const { order, path } = this.trajectory;
      const next = this.data.keyframes[order.slice(order.indexOf(which) + 1).find((i) => path.includes(i)) ?? which];
      const ahead = next ? sub(next.center, keyframe.center) : ([0, 0, 0] as Vec3);
      this.cameras.lookAlong(withPhoto || norm(ahead) === 0 ? fromCamera(keyframe, [0, 0, 1]) : ahead);
    }
    this.showPhoto(which);
    this.changed();
  }

  private showPhoto(which: number): void {
    const keyframe = this.data.keyframes[which];
    if (keyframe) this.panorama.show(this.state.mode === "keyframe" ? photoOf(keyframe) : "", keyframe);
  }

  /** From outside, turns around what is at pixels from the upper left corner. */
  setPivotAt(x: number, y: number): void {
    const found = isOutside(this.state.mode) ? this.pick(x, y) : null;
    if (found) this.tour.turnAround(found.position);
  }

  lookAlong(direction: Vec3): void {
    this.cameras.lookAlong(direction);
  }

  nudge(right: number, up: number, closer: number): void {
    this.cameras.nudge(right, up, closer);
  }

  private changed(): void {
    this.redraw();
    this.onChange();
  }

  /** The view, or what is drawn over the points, has changed. */
  redraw(): void {
    this.frames.moved();
  }

  /** The points have changed. */
  private pointsChanged(): void {
    this.frames.outdated();
  }

  /** Draws all points now. */
  draw(): void {
    this.frames.drawAll();
  }

  get renderer(): WebGLRenderer {
    return this.drawing.renderer;
  }

  /** Whether all is loaded and drawn. */
  get isIdle(): boolean {
    const isStreaming = this.stream !== null && !this.stream.isIdle;
    return this.isLoaded && this.frames.isIdle && !isStreaming && !this.panorama.isLoading && !this.tour.isMoving && !this.walking.isActive;
  }

  private begin(budget: number): { cubes: Cube[]; isAll: boolean } {
    const { state, cameras, drawing } = this;
    cameras.update();
    this.cloud.setLook(state.coloring, state.size, state.cut, this.isSeenThrough);
    this.placePhoto();
    drawing.clear();
    if (this.panorama.isOpaque) return { cubes: [], isAll: true };
    return this.cloud.choose(cameras.current, drawing.ratio * cameras.focalLength, drawing.ratio, budget);
  }

  private add(cubes: readonly Cube[]): void {
    this.cloud.show(cubes);
    this.drawing.add(this.cameras.current);
  }

  private present(): void {
    const { height, cameras, drawing } = this;
    drawing.present(cameras.current, height / cameras.focalLength);
    this.stream?.look(cameras.current, drawing.ratio * cameras.focalLength);
    this.drawOver();
  }

  /** Draws what lies over the points. */
  drawOver(): void {
    this.overlay.draw(this.width, this.height, this.drawing.ratio);
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
    return { pixel, reach: this.cameras.extent / 2, camera: (i) => (keyframes[i] ? this.trajectory.centerOf(keyframes[i]) : null) };
  }

  /** Unit that lengths are shown in. */
  get scale(): Scale {
    return scaleOf(this.data.unit, this.state.calibration, this.state.unit, { up: this.basis[2], ...this.eyes });
  }

  /** What a measurement says. */
  result(it: Measurement): Result {
    return resultOf(it, { up: this.basis[2], scale: this.scale, ...this.eyes });
  }

  /** Draws the whole plan as a picture of its own size, 1 : `scale`; `share`: of the picture that the bounds take. */
  planPicture(width: number, height: number, scale: number, share: number): HTMLCanvasElement {
    const [before, tall] = [this.width, this.height];
    this.setSize(width, height);
    this.overlay.printScale = scale;
    const picture = this.cameras.withWholePlan(share, () => this.picture());
    this.overlay.printScale = 0;
    this.setSize(before, tall);
    this.frames.drawFew();
    this.frames.moved();
    return picture;
  }

  /** Draws a square of the picture, `side` px wide, `zoom` times as large into a target. */
  drawPart(target: WebGLRenderTarget, left: number, top: number, side: number, zoom: number): void {
    const { cameras, cloud, width, height } = this;
    const camera = cameras.current;
    camera.setViewOffset(width, height, left, top, side, side);
    cloud.show(cloud.choose(camera, zoom * cameras.focalLength, 1, this.frames.pace.budget).cubes);
    this.placePhoto();
    this.drawing.drawInto(target, camera);
    camera.clearViewOffset();
    this.placePhoto();
    this.frames.restart();
  }

  private placePhoto(): void {
    this.panorama.place(this.perspective, this.state.mode === "keyframe" && !this.tour.isMoving ? 1 - this.state.fade : 0);
  }

  /** The picture with all that is drawn over it. */
  picture(): HTMLCanvasElement {
    this.draw();
    const copy = document.createElement("canvas");
    copy.width = this.canvas.width;
    copy.height = this.canvas.height;
    const context = copy.getContext("2d");
    context?.drawImage(this.canvas, 0, 0);
    context?.drawImage(this.overlay.canvas, 0, 0, copy.width, copy.height);
    return copy;
  }
}
