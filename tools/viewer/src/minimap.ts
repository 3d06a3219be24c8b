// SPDX-License-Identifier: BSD-2-Clause
// A small plan in a corner of the picture, with the path, the position and the direction.
import { el } from "./dom";
import { type Vec3, dot } from "./geometry";

/** Longer side, on a wide and on a narrow screen [px]. */
const kLength = [180, 110] as const;
const kMargin = 8;
const kMostPoints = 200_000;

interface MapSource {
  basis: readonly [Vec3, Vec3, Vec3];
  cloud: {
    loaded: number;
    low: Vec3;
    high: Vec3;
    forEach: (stride: number, visit: (x: number, y: number, z: number) => void) => void;
  };
  /** Heights that the map shows. */
  heights: () => [number, number];
}

export interface Position {
  eye: Vec3;
  direction: Vec3;
  /** Keyframes, in the order of the path. */
  places: readonly { index: number; center: Vec3 }[];
}

export class Minimap {
  readonly canvas = el("canvas", { id: "minimap", role: "img" });
  private readonly ground = document.createElement("canvas");
  private shown: Position | null = null;
  private scale = 1;
  /** Drawn. */
  private heights: [number, number] = [NaN, NaN];
  private readonly ratio = Math.min(window.devicePixelRatio || 1, 2);

  /** `go`: the nearest keyframe of a place that was clicked. */
  constructor(
    private readonly source: MapSource,
    go: (keyframe: number) => void,
  ) {
    this.canvas.hidden = true;
    this.canvas.addEventListener("click", (event) => {
      const places = this.shown?.places ?? [];
      const off = (center: Vec3): number => {
        const [x, y] = this.at(center);
        return Math.hypot(x - event.offsetX, y - event.offsetY);
      };
      const best = places.reduce((least, it) => (off(it.center) < off(least.center) ? it : least), places[0] ?? { index: -1, center: [0, 0, 0] });
      if (best.index >= 0) go(best.index);
    });
  }

  /** Pixels from the upper left corner. */
  private at(place: Vec3): [number, number] {
    const { basis, cloud } = this.source;
    return [kMargin + (dot(place, basis[0]) - cloud.low[0]) * this.scale, kMargin + (cloud.high[1] - dot(place, basis[1])) * this.scale];
  }

  /** Draws the points again: they, or the heights to show, have changed. */
  update(): void {
    const { basis, cloud } = this.source;
    const [wide, deep] = [Math.max(cloud.high[0] - cloud.low[0], 1e-9), Math.max(cloud.high[1] - cloud.low[1], 1e-9)];
    this.scale = (kLength[window.innerWidth < 640 ? 1 : 0] - 2 * kMargin) / Math.max(wide, deep);
    const [width, height] = [wide * this.scale + 2 * kMargin, deep * this.scale + 2 * kMargin];
    for (const canvas of [this.canvas, this.ground]) [canvas.width, canvas.height] = [width * this.ratio, height * this.ratio];
    [this.canvas.style.width, this.canvas.style.height] = [`${width}px`, `${height}px`];
    const columns = this.ground.width;
    const counts = new Float32Array(columns * this.ground.height);
    const [low, high] = (this.heights = this.source.heights());
    cloud.forEach(Math.max(1, Math.ceil(cloud.loaded / kMostPoints)), (x, y, z) => {
      const level = dot([x, y, z], basis[2]);
      if (level < low || level > high) return;
      const [px, py] = this.at([x, y, z]).map((v) => Math.floor(v * this.ratio)) as [number, number];
      if (px >= 0 && py >= 0 && px < columns && py < this.ground.height) counts[py * columns + px]! += 1;
    });
    const context = this.ground.getContext("2d");
    if (!context || columns === 0 || this.ground.height === 0) return;
    // Walls stand out: many points lie above each other.
    const sorted = counts.filter((n) => n > 0).sort();
    const most = sorted[Math.floor(0.95 * sorted.length)] ?? 1;
    const image = context.createImageData(columns, this.ground.height);
    counts.forEach((n, i) => image.data.set([225, 230, 235, n > 0 ? 50 + 205 * Math.min(1, n / most) : 0], 4 * i));
    context.putImageData(image, 0, 0);
    if (this.shown) this.show(this.shown);
  }

  /** null = hidden. */
  show(position: Position | null): void {
    this.canvas.hidden = position === null;
    this.shown = position;
    if (position && this.source.heights().some((x, i) => x !== this.heights[i])) return this.update();
    const context = this.canvas.getContext("2d");
    if (!position || !context) return;
    const { basis } = this.source;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    if (this.ground.width > 0) context.drawImage(this.ground, 0, 0);
    context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    context.strokeStyle = "rgba(255, 210, 63, 0.7)";
    context.beginPath();
    for (const { center } of position.places) context.lineTo(...this.at(center));
    context.stroke();
    context.fillStyle = "#ffd23f";
    for (const { center } of position.places) context.fillRect(this.at(center)[0] - 1.5, this.at(center)[1] - 1.5, 3, 3);
    const [x, y] = this.at(position.eye);
    const angle = Math.atan2(-dot(position.direction, basis[1]), dot(position.direction, basis[0]));
    context.beginPath();
    context.moveTo(x, y);
    context.arc(x, y, 26, angle - 0.5, angle + 0.5);
    context.closePath();
    context.fillStyle = "rgba(76, 194, 255, 0.45)";
    context.fill();
    context.beginPath();
    context.arc(x, y, 5, 0, 2 * Math.PI);
    context.fillStyle = "#4cc2ff";
    context.fill();
    context.strokeStyle = "#000";
    context.stroke();
    const compass = Math.round((((Math.PI / 2 - Math.atan2(dot(position.direction, basis[1]), dot(position.direction, basis[0]))) * 180) / Math.PI + 360) % 360);
    this.canvas.setAttribute("aria-label", `Plan with the position, looking ${compass} degrees clockwise from the top of the plan`);
  }
}
