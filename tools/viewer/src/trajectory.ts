// SPDX-License-Identifier: BSD-2-Clause
// Keyframes along the trajectory, and the storeys they were flown on. `order`: indices of the existing keyframes, from
// the first to the last.
import type { Cloud } from "./cloud";
import type { KeyframeData, ReportData } from "./data";
import { type Vec3, dot, norm, sub, unit } from "./geometry";
import { hasPhoto } from "./panorama";
import type { Mode } from "./state";
import { type Storey, storeysOf } from "./storeys";

/** Returns those with a depth map, or all if there are none. */
export function pathOf(keyframes: readonly KeyframeData[], order: readonly number[]): number[] {
  const used = order.filter((i) => keyframes[i]?.use === "depth map");
  return used.length > 0 ? used : [...order];
}

/** Returns the next one of `path` after `which` (`by` < 0: before) along the trajectory, from its other end after the last. */
export function stepFrom(order: readonly number[], path: readonly number[], which: number, by: number): number | undefined {
  const way = by > 0 ? order : [...order].reverse();
  const at = way.indexOf(which) + 1;
  return [...way.slice(at), ...way.slice(0, at)].find((i) => path.includes(i));
}

/** Returns the nearest one along the trajectory; with `withPhoto` one with a photo, if there is any. */
export function nearestKeyframe(
  keyframes: readonly KeyframeData[],
  order: readonly number[],
  which: number,
  withPhoto: boolean,
): number {
  let able = order.filter((i) => !withPhoto || hasPhoto(keyframes[i]));
  if (able.length === 0) able = pathOf(keyframes, order);
  const rank = new Map(order.map((index, i) => [index, i]));
  const rankOf = (index: number): number => rank.get(index) ?? index;
  const distance = (index: number): number => Math.abs(rankOf(index) - rankOf(which));
  return able.reduce((best, i) => (distance(i) < distance(best) ? i : best), able[0] ?? 0);
}

/** Ring at a keyframe, to click on. */
export interface Ring {
  keyframe: number;
  x: number;
  y: number;
  /** [px] */
  radius: number;
  hasPoints: boolean;
  isCurrent: boolean;
}

export interface KeyframePlace {
  /** In ReportData.keyframes. */
  index: number;
  /** From the page's origin. */
  center: Vec3;
  hasPoints: boolean;
}

/** Rings around one that stands at a keyframe. */
const kNearRings = 12;

/** Rings of keyframes: all from outside; from a keyframe those nearest to the eye, large where they are near. */
export function ringsIn(
  places: readonly KeyframePlace[],
  current: number,
  mode: Mode,
  project: (p: Vec3) => [number, number] | null,
  eye: Vec3,
): Ring[] {
  const isOutside = mode === "orbit" || mode === "plan";
  let some = places.map((it) => ({ ...it, distance: norm(sub(it.center, eye)) }));
  if (!isOutside) some = some.filter((it) => it.index !== current && it.distance > 0).sort((a, b) => a.distance - b.distance).slice(0, kNearRings);
  const nearest = Math.min(...some.map((it) => it.distance));
  return some.flatMap(({ index, center, hasPoints, distance }) => {
    const at = project(center);
    if (!at) return [];
    const isCurrent = index === current;
    const radius = isOutside ? (isCurrent ? 7 : some.length > 200 ? 3 : 4.5) : Math.max(6, (16 * nearest) / distance);
    return [{ keyframe: index, x: at[0], y: at[1], radius, hasPoints, isCurrent }];
  });
}

/** The nearest ring within `reach` pixels of its rim. */
export function ringAt(rings: readonly Ring[], x: number, y: number, reach: number): Ring | null {
  let best: Ring | null = null;
  let least = reach;
  for (const ring of rings) {
    const off = Math.max(0, Math.hypot(ring.x - x, ring.y - y) - ring.radius);
    if (off >= least) continue;
    least = off;
    best = ring;
  }
  return best;
}

/** The keyframe nearest in a direction, within 60 degrees of it; -1 = none. */
export function keyframeTowards(centers: readonly { index: number; center: Vec3 }[], from: Vec3, direction: Vec3): number {
  let best = -1;
  let least = Number.POSITIVE_INFINITY;
  for (const { index, center } of centers) {
    const off = sub(center, from);
    const distance = norm(off);
    if (!(distance > 0) || distance >= least || dot(off, direction) < 0.5 * distance * norm(direction)) continue;
    least = distance;
    best = index;
  }
  return best;
}

export class Trajectory {
  /** Indices of the existing keyframes in the order of the trajectory. */
  order: number[];
  /** Those of `order` with a depth map; all if there are none. */
  path: number[];
  /** Where the camera of a live map is. */
  camera: Vec3 | null = null;
  storeys: Storey[] = [];

  constructor(private readonly data: ReportData) {
    this.order = data.keyframes.map((_, i) => i);
    this.path = pathOf(data.keyframes, this.order);
  }

  /** Live page only. */
  set(keyframes: KeyframeData[], order: number[], camera: Vec3 | null): void {
    this.data.keyframes = keyframes;
    this.order = order;
    this.path = pathOf(keyframes, order);
    this.camera = camera;
  }

  /** Of a keyframe's camera, from the page's origin. */
  centerOf(keyframe: KeyframeData): Vec3 {
    return sub(keyframe.center, this.data.origin);
  }

  private at(which: number): Vec3 | null {
    const keyframe = this.data.keyframes[which];
    return keyframe ? this.centerOf(keyframe) : null;
  }

  get centers(): Vec3[] {
    return this.order.map((i) => this.at(i)!);
  }

  get places(): KeyframePlace[] {
    return this.order.map((index) => ({ index, center: this.at(index)!, hasPoints: this.data.keyframes[index]!.use === "depth map" }));
  }

  /** Those that steps go to: with a photo where the mode shows them. */
  pathIn(mode: Mode): number[] {
    const withPhoto = mode === "keyframe" ? this.path.filter((i) => hasPhoto(this.data.keyframes[i])) : [];
    return withPhoto.length > 0 ? withPhoto : this.path;
  }

  private heightOf(which: number): number {
    const at = this.at(which);
    return at ? dot(at, unit(this.data.up)) : Number.POSITIVE_INFINITY;
  }

  /** To be called when the cloud's bounds have changed. */
  measureStoreys(cloud: Cloud, hasNormals: boolean): void {
    const floors = hasNormals ? cloud.floorHeights(Math.max(1, Math.floor(cloud.loaded / 50_000))) : [];
    this.storeys = storeysOf(floors, this.path.map((i) => this.heightOf(i)), cloud.low[2], cloud.high[2]);
  }

  storeyOf(which: number): Storey {
    const height = this.heightOf(which);
    return this.storeys.filter((it) => it.floor < height).at(-1) ?? this.storeys[0] ?? { floor: 0, top: null, camera: 0, highestCamera: 0 };
  }

  /** A keyframe of a storey: `current` if it is one. */
  keyframeOn(storey: Storey, current: number): number {
    const isOn = (i: number): boolean => this.heightOf(i) > storey.floor && this.heightOf(i) < (storey.top ?? Number.POSITIVE_INFINITY);
    return isOn(current) ? current : (this.path.find(isOn) ?? current);
  }
}
