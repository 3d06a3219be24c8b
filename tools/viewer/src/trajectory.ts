// SPDX-License-Identifier: BSD-2-Clause
// Keyframes along the trajectory. `order`: indices of the existing keyframes, from the first to the last.
import type { KeyframeData } from "./data";
import { type Vec3, dot, norm, sub } from "./geometry";
import { hasPhoto } from "./panorama";
import type { Mode } from "./state";

/** Returns those with a depth map, or all if there are none. */
export function pathOf(keyframes: readonly KeyframeData[], order: readonly number[]): number[] {
  const used = order.filter((i) => keyframes[i]?.use === "depth map");
  return used.length > 0 ? used : [...order];
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
