// SPDX-License-Identifier: BSD-2-Clause
// Measurements, notes, keyframes and the scale bar, drawn over the points.
import { type Vec3, dot, norm, roundLength, sub } from "./geometry";
import { marksOf } from "./marks";
import type { Scale } from "./measure";
import { kPickRadius, pick } from "./pick";
import { isOutside } from "./tour";
import { type Ring, ringAt, ringsIn } from "./trajectory";
import type { Viewer } from "./viewer";

export interface Mark {
  /** A line through them, or one place. */
  points: Vec3[];
  /** Places with a dot. */
  dots: Vec3[];
  closed: boolean;
  text: string;
}
interface ScaleBar {
  pixels: number;
  text: string;
}

/** `perUnit`: pixels per unit of the page, at a distance; null = at any. */
export function scaleBar(perUnit: number, { unit, factor }: Scale, distance: number | null): ScaleBar {
  const length = roundLength((160 / perUnit) * factor);
  const text = `${Number(length.toPrecision(3))} ${unit}`;
  const at = distance === null ? "" : ` at ${Number((factor * distance).toPrecision(2))} ${unit}`;
  return { pixels: (length / factor) * perUnit, text: text + at };
}

/** The path of the camera. */
interface Trail {
  line: Vec3[];
  rings: readonly Ring[];
  /** Of a live map, where it is now. */
  camera: Vec3 | null;
  /** Of the current keyframe. */
  label: string;
}

type Project = (p: Vec3) => [number, number] | null;

const kLine = "#ffd23f";
const kBack = "rgba(0, 0, 0, 0.75)";

/** An arrow in the upper left corner; `angle`: clockwise from the top [rad]. */
function drawNorth(context: CanvasRenderingContext2D, angle: number): void {
  context.save();
  context.translate(40, 40);
  context.rotate(angle);
  context.fillStyle = kBack;
  context.beginPath();
  context.arc(0, 0, 28, 0, 2 * Math.PI);
  context.fill();
  context.fillStyle = "#fff";
  context.beginPath();
  for (const [x, y] of [[0, -8], [8, 20], [0, 13], [-8, 20]] as const) context.lineTo(x, y);
  context.fill();
  context.textAlign = "center";
  context.fillText("N", 0, -16);
  context.restore();
}

/** Draws on a canvas that lies over the points, or on the picture that is saved. */
function drawOverlay(
  context: CanvasRenderingContext2D,
  width: number,
  height: number,
  ratio: number,
  project: Project,
  marks: readonly Mark[],
  bar: ScaleBar | null,
  trail: Trail | null,
): void {
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.font = "14px system-ui, sans-serif";
  context.textBaseline = "middle";
  const label = (text: string, x: number, y: number): void => {
    const wide = context.measureText(text).width + 12;
    const left = Math.max(2, Math.min(width - wide - 2, x - wide / 2));
    context.fillStyle = kBack;
    context.fillRect(left, y - 11, wide, 22);
    context.fillStyle = "#fff";
    context.fillText(text, left + 6, y);
  };
  if (trail) drawTrail(context, project, trail, label);
  for (const mark of marks) {
    const places = mark.points.map(project);
    const seen = places.filter((p): p is [number, number] => p !== null);
    const ends = mark.closed && places.length > 2 ? [...places, places[0] ?? null] : places;
    for (const [color, wide] of [["#000", 5] as const, [kLine, 2.5] as const]) {
      context.strokeStyle = color;
      context.lineWidth = wide;
      context.beginPath();
      for (let i = 0; i + 1 < ends.length; ++i) {
        const [from, to] = [ends[i], ends[i + 1]];
        if (!from || !to) continue;
        context.moveTo(...from);
        context.lineTo(...to);
      }
      context.stroke();
    }
    for (const [x, y] of mark.dots.map(project).filter((p) => p !== null)) {
      context.beginPath();
      context.arc(x, y, 5, 0, 2 * Math.PI);
      context.fillStyle = kLine;
      context.fill();
      context.lineWidth = 1.5;
      context.strokeStyle = "#000";
      context.stroke();
    }
    if (seen.length > 0 && mark.text !== "") {
      const mean = (k: 0 | 1): number => seen.reduce((sum, p) => sum + p[k], 0) / seen.length;
      label(mark.text, mean(0), mean(1) - 18);
    }
  }
  if (!bar) return;
  const [x, y] = [16, height - 20];
  context.fillStyle = kBack;
  context.fillRect(x - 8, y - 28, Math.max(bar.pixels, context.measureText(bar.text).width) + 16, 40);
  context.fillStyle = "#fff";
  context.fillText(bar.text, x, y - 14);
  context.fillRect(x, y, bar.pixels, 4);
  context.fillRect(x, y - 5, 2, 10);
  context.fillRect(x + bar.pixels - 2, y - 5, 2, 10);
}

/** Keyframes with points have a dot in their ring. */
function drawTrail(
  context: CanvasRenderingContext2D,
  project: Project,
  trail: Trail,
  label: (text: string, x: number, y: number) => void,
): void {
  context.beginPath();
  let isDown = false;
  for (const at of trail.line.map(project)) {
    if (at && isDown) context.lineTo(...at);
    else if (at) context.moveTo(...at);
    isDown = at !== null;
  }
  context.lineWidth = 1.5;
  context.strokeStyle = "rgba(255, 210, 63, 0.5)";
  context.stroke();
  for (const { x, y, radius, hasPoints, isCurrent } of trail.rings) {
    for (const [color, wide] of [["rgba(0, 0, 0, 0.6)", isCurrent ? 6 : 3.5] as const, [isCurrent ? "#4cc2ff" : hasPoints ? kLine : "#fff", isCurrent ? 3 : 1.5] as const]) {
      context.beginPath();
      context.arc(x, y, radius, 0, 2 * Math.PI);
      context.lineWidth = wide;
      context.strokeStyle = color;
      context.stroke();
    }
    if (isCurrent && trail.label !== "") label(trail.label, x, y - radius - 16);
    if (!hasPoints) continue;
    context.beginPath();
    context.arc(x, y, radius / 3, 0, 2 * Math.PI);
    context.fillStyle = kLine;
    context.fill();
  }
  const camera = trail.camera && project(trail.camera);
  if (!camera) return;
  context.beginPath();
  context.arc(...camera, 8, 0, 2 * Math.PI);
  context.lineWidth = 3;
  context.strokeStyle = kLine;
  context.stroke();
  label("camera", camera[0], camera[1] - 22);
}

export class Overlay {
  /** Draws over the points, below the marks. */
  under: ((context: CanvasRenderingContext2D, project: Project) => void) | null = null;
  /** Whether the current keyframe was chosen from outside, which then is shown. */
  isStepped = false;
  /** 1 : this, while a plan is printed; 0 = it is not. */
  printScale = 0;
  /** Rings of the keyframes in the picture. */
  private rings: Ring[] = [];
  /** From the eye to what is seen in the middle, where one stands at a keyframe; 0 = not known yet. */
  private middleDistance = 0;

  constructor(
    readonly canvas: HTMLCanvasElement,
    private readonly viewer: Viewer,
  ) {}

  resize(width: number, height: number): void {
    [this.canvas.width, this.canvas.height] = [width, height];
  }

  /** The view begins elsewhere. */
  forget(): void {
    this.isStepped = false;
    this.middleDistance = 0;
  }

  /** The keyframe whose ring is at pixels from the upper left corner, -1 = none. `reach`: beside the ring [px]. */
  keyframeAt(x: number, y: number, reach: number): number {
    return ringAt(this.rings, x, y, reach)?.keyframe ?? -1;
  }

  draw(width: number, height: number, ratio: number): void {
    const { state, cameras, trajectory, basis, data, pending } = this.viewer;
    const context = this.canvas.getContext("2d");
    if (!context) return;
    const project: Project = (p) => cameras.project(p);
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.under?.(context, project);
    this.rings = ringsIn(trajectory.places, state.keyframe, state.mode, project, cameras.eye);
    const marks = marksOf(state, pending, basis[2], (it) => this.viewer.result(it).text);
    drawOverlay(context, width, height, ratio, project, marks, this.scaleBar(), this.trail());
    const { north } = data;
    if (state.mode === "plan" && north) drawNorth(context, Math.atan2(dot(north, basis[0]), dot(north, basis[1])));
  }

  /** Distance of what is in the middle of the picture, for the scale bar. */
  measureMiddle(): void {
    const { cameras, canvas, cloud, state } = this.viewer;
    const { clientWidth: width, clientHeight: height } = canvas;
    if (isOutside(state.mode)) return;
    const found = pick(cloud, cameras.current, width / 2, height / 2, width, height, kPickRadius);
    this.middleDistance = found ? norm(sub(found.position, cameras.eye)) : 0;
    this.viewer.drawOver();
  }

  private trail(): Trail {
    const { state, data, trajectory } = this.viewer;
    const id = data.keyframes[state.keyframe]?.id;
    return {
      line: isOutside(state.mode) ? trajectory.centers : [],
      rings: this.rings,
      camera: trajectory.camera,
      label: this.isStepped && id !== undefined ? `keyframe ${id}` : "",
    };
  }

  /** Of a plan; else at the distance of what is in the middle. */
  private scaleBar(): ScaleBar | null {
    const { state, cameras, scale } = this.viewer;
    if (state.mode === "plan") {
      const bar = scaleBar(cameras.focalLength, scale, null);
      return this.printScale > 0 ? { ...bar, text: `${bar.text}, 1 : ${this.printScale}` } : bar;
    }
    const distance = state.mode === "orbit" ? cameras.pivotDistance : this.middleDistance;
    return distance > 0 ? scaleBar(cameras.focalLength / distance, scale, distance) : null;
  }
}
