// SPDX-License-Identifier: BSD-2-Clause
// What is not covered yet: the directions from the camera of a run in which there are no points.
import { el, percentText } from "./dom";
import { type Pose, type Vec3, panoramaPlace, sub, toCamera } from "./geometry";
import { colorAt } from "./palette";
import { Throttle } from "./throttle";

const kWidth = 72;
const kHeight = 36;
const kMaxPoints = 500_000; // that are looked at
const kPause = 700; // [ms]

/** Axes of the camera: right, down, forward. */
const sides = ["right", "left", "below", "above", "ahead", "behind"] as const;
export type Side = (typeof sides)[number];

interface Covered {
  width: number;
  height: number;
  /** Row by row: 1 = there is a point. The middle is straight ahead, the first row straight up. */
  seen: Uint8Array<ArrayBuffer>;
  /** Of all directions, the share that has none. */
  open: number;
  /** Sides where three of five directions have none. */
  openSides: Side[];
}

interface Points {
  loaded: number;
  forEach: (stride: number, visit: (x: number, y: number, z: number) => void) => void;
}

/** `pose`: from the page's origin. */
export function coveredAround(points: Points, pose: Pose): Covered {
  const seen = new Uint8Array(kWidth * kHeight);
  points.forEach(Math.max(1, Math.ceil(points.loaded / kMaxPoints)), (x, y, z) => {
    const p = toCamera(pose, sub([x, y, z], pose.center));
    const length = Math.hypot(p[0], p[1], p[2]);
    if (!(length > 0)) return;
    const [across, down] = panoramaPlace(p);
    const column = Math.floor(across * kWidth);
    const row = Math.floor(down * kHeight);
    // Cells near the poles are narrow: a point fills as much of its row there as elsewhere.
    const wide = Math.min(kWidth / 2, 0.5 / Math.max(Math.hypot(p[0], p[2]) / length, 1e-6) - 0.5);
    for (let by = -Math.round(wide); by <= Math.round(wide); ++by) {
      seen[Math.min(row, kHeight - 1) * kWidth + ((column + by + 2 * kWidth) % kWidth)] = 1;
    }
  });
  const all = new Map<Side, [number, number]>(sides.map((side) => [side, [0, 0]]));
  const whole: [number, number] = [0, 0];
  for (let row = 0; row < kHeight; ++row) {
    const latitude = Math.PI * ((row + 0.5) / kHeight - 0.5); // downward
    for (let column = 0; column < kWidth; ++column) {
      const longitude = 2 * Math.PI * ((column + 0.5) / kWidth - 0.5);
      const solid = Math.cos(latitude);
      const isOpen = seen[row * kWidth + column] === 0 ? 1 : 0;
      const ray: Vec3 = [solid * Math.sin(longitude), Math.sin(latitude), solid * Math.cos(longitude)];
      for (const sum of [whole, all.get(sideOf(ray))]) {
        if (!sum) continue;
        sum[0] += solid * isOpen;
        sum[1] += solid;
      }
    }
  }
  const openSides = sides.filter((side) => (all.get(side)?.[0] ?? 0) > 0.6 * (all.get(side)?.[1] ?? 1));
  return { width: kWidth, height: kHeight, seen, open: whole[0] / whole[1], openSides };
}

function sideOf(ray: Vec3): Side {
  const axis = ray.reduce((best, x, i) => (Math.abs(x) > Math.abs(ray[best as 0]) ? i : best), 0);
  return sides[2 * axis + (ray[axis as 0] > 0 ? 0 : 1)] ?? "ahead";
}

/** "31 % of the directions from the camera have no points yet, mostly behind and below." */
export function openText(covered: Covered): string {
  const list = covered.openSides;
  const where = list.length === 0 || list.length === sides.length ? "" : `, mostly ${list.join(", ").replace(/, (\w+)$/, " and $1")}`;
  return `${percentText(covered.open)} of the directions from the camera have no points yet${where}.`;
}

/** The panorama of what is covered, in a corner of the picture. */
export class Around {
  covered: Covered | null = null;
  private readonly canvas = el("canvas", { width: String(kWidth), height: String(kHeight), role: "img" });
  private readonly text = el("p", {});
  private readonly box = el("div", { id: "around" }, this.canvas, this.text);
  private readonly later = new Throttle(kPause, () => {
    const pose = this.pose();
    this.box.hidden = pose === null;
    if (pose) this.show(coveredAround(this.points, pose));
  });

  /** `pose`: of the camera; null = not known yet. */
  constructor(
    place: HTMLElement,
    private readonly points: Points,
    private readonly pose: () => Pose | null,
  ) {
    this.box.hidden = true;
    place.append(this.box);
  }

  /** Points or camera have changed; what comes of it is shown a moment later. */
  changed(): void {
    this.later.request();
  }

  private show(covered: Covered): void {
    this.covered = covered;
    const context = this.canvas.getContext("2d");
    if (!context) return;
    const image = context.createImageData(covered.width, covered.height);
    covered.seen.forEach((isSeen, i) => image.data.set([...colorAt("cividis", isSeen), 255], 4 * i));
    context.putImageData(image, 0, 0);
    this.text.textContent = openText(covered);
    this.canvas.setAttribute("aria-label", `Panorama around the camera, straight ahead in the middle; dark where there are no points. ${openText(covered)}`);
  }
}
