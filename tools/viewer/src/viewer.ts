// SPDX-License-Identifier: BSD-2-Clause
// The points as a picture: loading, views, drawing, picking.
import type { Camera, PerspectiveCamera, WebGLRenderTarget, WebGLRenderer } from "three";
import { Cameras } from "./cameras";
import { Cloud, type Cube } from "./cloud";
import { type Cut, cutFromShares, isSameCut, noCut, planCut } from "./cuts";
import type { KeyframeData, ReportData } from "./data";
import { type KeyframePlace, nearestKeyframe, pathOf, type Ring, ringAt, ringsIn } from "./trajectory";
import { straightBasis } from "./framing";
import { type Vec3, dot, fromCamera, mainDirection, norm, sub } from "./geometry";
import { Frames } from "./frames";
import { loadHeld, rootNormals } from "./load";
import { scaleOf } from "./lengths";
import { marksOf } from "./marks";
import { type Picked, type Result, type Scale, type Taken, resultOf } from "./measure";
import { drawNorth, drawOverlay, type ScaleBar, scaleBar, type Trail } from "./overlay";
import type { Position } from "./minimap";
import { Walking } from "./navigate";
import { Panorama, hasPhoto, photoOf } from "./panorama";
import { pick } from "./pick";
import { Picture } from "./picture";
import type { Measurement, Mode, ViewState } from "./state";
import { type Storey, storeysOf } from "./storeys";
import { Stream } from "./stream";
import { type Eyes, pickedFrom } from "./surroundings";
import { Throttle } from "./throttle";
import { isOutside, Tour } from "./tour";

const kPickRadius = 12;

export class Viewer {
  readonly cloud: Cloud;
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
  /** The bounds of the cloud were measured. */
  onExtent: () => void = () => {};
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
  readonly frames: Frames;
  readonly tour: Tour;
  private readonly walking: Walking;
  /** Whether the current keyframe was chosen from outside, which then is shown. */
  private isStepped = false;
  private readonly drawing: Picture;
  readonly panorama: Panorama;
  private width = 1;
  private height = 1;
  /** Where the camera of a live map is. */
  private liveCamera: Vec3 | null = null;
  /** Rings of the keyframes in the picture. */
  private rings: Ring[] = [];
  /** From the eye to what is seen in the middle, where one stands at a keyframe; 0 = not known yet. */
  private middleDistance = 0;
  storeys: Storey[] = [];
  /** That the plan made, not the user. */
  private cutOfPlan = noCut();
  /** 1 : this, while a plan is printed; 0 = it is not. */
  private printScale = 0;
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
    readonly overlay: HTMLCanvasElement,
    readonly state: ViewState,
  ) {
    this.order = data.keyframes.map((_, i) => i);
    this.path = pathOf(data.keyframes, this.order);
    const path = mainDirection(this.centers(), data.up);
    this.basis = straightBasis(data.up, path, state.isAlongPath ? [] : rootNormals(data.nodes));
    this.cloud = new Cloud(data.nodes, this.basis, data.normals !== false);
    this.panorama = new Panorama(() => this.redraw());
    this.cameras = new Cameras(canvas, state, this.basis, this.cloud, () => this.changed());
    this.drawing = new Picture(canvas, this.cloud.group, this.panorama.mesh, () => this.redraw());
    this.frames = new Frames({
      begin: (budget) => this.begin(budget),
      add: (cubes) => this.add(cubes),
      present: () => this.present(),
      completed: () => setTimeout(() => this.measureMiddle()),
      whenFinished: (done) => this.drawing.whenFinished(done),
    });
    this.frames.listen(canvas);
    this.tour = new Tour(this.cameras, state, {
      places: () => this.keyframeCenters,
      path: (mode) => this.pathIn(mode),
      enter: (which) => this.enter(which, state.mode === "keyframe", false),
      prepare: (which) => this.showPhoto(which),
      marked: () => {
        this.isStepped = true;
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
    this.data.keyframes = keyframes;
    this.order = order;
    this.path = pathOf(keyframes, order);
    this.liveCamera = camera;
    this.updateExtentLater.request();
    this.pointsChanged();
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
    const { cloud, state, basis } = this;
    cloud.measureExtent(this.centers(), this.landmarks);
    const heights = this.path.map((i) => dot(this.centerOf(this.data.keyframes[i]!), basis[2]));
    const floors = this.data.normals === false ? [] : cloud.floorHeights(Math.max(1, Math.floor(cloud.loaded / 50_000)));
    this.storeys = storeysOf(floors, heights, cloud.low[2], cloud.high[2]);
    if (state.clip) state.cut = cutFromShares(state.clip, cloud.low, cloud.high);
    this.onExtent();
  }

  /** For the small plan; null in views from outside. */
  get position(): Position | null {
    const { cameras, state } = this;
    if (isOutside(state.mode)) return null;
    return { eye: cameras.eye, direction: cameras.directionOf(0, 1), places: this.keyframeCenters };
  }

  /** Heights that a plan of the current storey shows. */
  get planHeights(): [number, number] {
    const cut = this.automaticCut;
    return [cut[4] ?? Number.NEGATIVE_INFINITY, cut[5] ?? Number.POSITIVE_INFINITY];
  }

  /** The storey of the current keyframe. */
  get storey(): Storey {
    const keyframe = this.data.keyframes[this.state.keyframe];
    const height = keyframe ? dot(this.centerOf(keyframe), this.basis[2]) : Number.POSITIVE_INFINITY;
    return this.storeys.filter((it) => it.floor < height).at(-1) ?? this.storeys[0] ?? { floor: 0, top: null, camera: 0, highestCamera: 0 };
  }

  /** Makes a keyframe of a storey the current one. */
  showStorey(storey: Storey): void {
    const heightOf = (i: number): number => dot(this.centerOf(this.data.keyframes[i]!), this.basis[2]);
    const isOn = (i: number): boolean => heightOf(i) > storey.floor && heightOf(i) < (storey.top ?? Number.POSITIVE_INFINITY);
    const { state } = this;
    if (!isOn(state.keyframe)) state.keyframe = this.path.find(isOn) ?? state.keyframe;
  }

  private get automaticCut(): Cut {
    return planCut(this.storey, this.storey === this.storeys[0]);
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
    this.overlay.width = this.canvas.width;
    this.overlay.height = this.canvas.height;
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
    this.isStepped = false;
    this.middleDistance = 0;
    if (mode === "orbit") {
      if (eye && target) cameras.lookFromOutside(eye, target);
      else cameras.lookAtAll((camera) => this.placesToShow(camera));
    } else if (mode === "plan") {
      if (fresh && isSameCut(state.cut, noCut()) && this.cloud.loaded > 0) state.cut = this.cutOfPlan = this.automaticCut;
      cameras.lookFromAbove(eye, target, fresh ? 1 : state.zoom);
    } else {
      state.keyframe = nearestKeyframe(this.data.keyframes, this.order, state.keyframe, mode === "keyframe");
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
    const places = [...this.centers(), ...this.landmarks];
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
    this.cameras.standAt(this.centerOf(keyframe));
    if (fresh) {
      const next = this.data.keyframes[this.path[this.path.indexOf(which) + 1] ?? which];
      const ahead = next ? sub(next.center, keyframe.center) : ([0, 0, 0] as Vec3);
      this.cameras.lookAlong(withPhoto || norm(ahead) === 0 ? fromCamera(keyframe, [0, 0, 1]) : ahead);
    }
    this.showPhoto(which);
    this.changed();
  }

  /** Those that steps go to: with a photo where the mode shows them. */
  private pathIn(mode: Mode): number[] {
    const withPhoto = mode === "keyframe" ? this.path.filter((i) => hasPhoto(this.data.keyframes[i])) : [];
    return withPhoto.length > 0 ? withPhoto : this.path;
  }

  private showPhoto(which: number): void {
    const keyframe = this.data.keyframes[which];
    if (keyframe) this.panorama.show(this.state.mode === "keyframe" ? photoOf(keyframe) : "", keyframe);
  }

  /** The keyframe whose ring is at pixels from the upper left corner, -1 = none. `reach`: beside the ring [px]. */
  keyframeAt(x: number, y: number, reach: number): number {
    return ringAt(this.rings, x, y, reach)?.keyframe ?? -1;
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
    const { state, width, height, cameras, drawing } = this;
    const context = this.overlay.getContext("2d");
    if (!context) return;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, this.overlay.width, this.overlay.height);
    context.setTransform(drawing.ratio, 0, 0, drawing.ratio, 0, 0);
    this.under?.(context, (p) => this.project(p));
    this.rings = ringsIn(this.keyframeCenters, state.keyframe, state.mode, (p) => this.project(p), cameras.eye);
    const marks = marksOf(state, this.pending, this.basis[2], (it) => this.result(it).text);
    drawOverlay(context, width, height, drawing.ratio, (p) => this.project(p), marks, this.scaleBar(), this.trail());
    const { north } = this.data;
    if (state.mode === "plan" && north) drawNorth(context, Math.atan2(dot(north, this.basis[0]), dot(north, this.basis[1])));
  }

  /** Distance of what is in the middle of the picture, for the scale bar. */
  private measureMiddle(): void {
    const { cameras, width, height, state } = this;
    if (isOutside(state.mode) || !this.isLoaded) return;
    const found = pick(this.cloud, cameras.current, width / 2, height / 2, width, height, kPickRadius);
    this.middleDistance = found ? norm(sub(found.position, cameras.eye)) : 0;
    this.drawOver();
  }

  /** Existing keyframes, in the order of the trajectory. */
  private get keyframeCenters(): KeyframePlace[] {
    return this.order.map((index) => {
      const keyframe = this.data.keyframes[index]!;
      return { index, center: this.centerOf(keyframe), hasPoints: keyframe.use === "depth map" };
    });
  }

  private trail(): Trail {
    const { state, data } = this;
    const id = data.keyframes[state.keyframe]?.id;
    return {
      line: isOutside(state.mode) ? this.keyframeCenters.map((it) => it.center) : [],
      rings: this.rings,
      camera: this.liveCamera,
      label: this.isStepped && id !== undefined ? `keyframe ${id}` : "",
    };
  }

  /** Of a plan; else at the distance of what is in the middle. */
  private scaleBar(): ScaleBar | null {
    const { state, cameras } = this;
    if (state.mode === "plan") {
      const bar = scaleBar(cameras.focalLength, this.scale, null);
      return this.printScale > 0 ? { ...bar, text: `${bar.text}, 1 : ${this.printScale}` } : bar;
    }
    const distance = state.mode === "orbit" ? cameras.pivotDistance : this.middleDistance;
    return distance > 0 ? scaleBar(cameras.focalLength / distance, this.scale, distance) : null;
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

  /** Draws the whole plan as a picture of its own size, 1 : `scale`; `share`: of the picture that the bounds take. */
  planPicture(width: number, height: number, scale: number, share: number): HTMLCanvasElement {
    const [before, tall] = [this.width, this.height];
    this.setSize(width, height);
    this.printScale = scale;
    const picture = this.cameras.withWholePlan(share, () => this.picture());
    this.printScale = 0;
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
    context?.drawImage(this.overlay, 0, 0, copy.width, copy.height);
    return copy;
  }
}
