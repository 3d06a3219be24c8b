// SPDX-License-Identifier: BSD-2-Clause
// Which part of a cloud a picture should show. tools/pmsp-densify/framing.h does the same for the pictures of --preview.
import type { Vec3 } from "./geometry";

const kOutermost = 1; // percent at either end that are never looked at
const kInnermost = 45;
const kWorth = 8;

/**
 * The stretch from a percentile to another that is as short as can be for the share of the values in it: a crowd far
 * away, such as what is seen through a window, does not make the room small. `values`: not empty; gets sorted.
 */
export function busyStretch(values: number[]): [number, number] {
  values.sort((a, b) => a - b);
  const at = (percent: number): number => values[Math.floor((percent * (values.length - 1)) / 100)] ?? 0;
  let best: [number, number] = [at(kOutermost), at(100 - kOutermost)];
  const least = 1e-6 * (best[1] - best[0]); // many values may be the same
  if (!(least > 0)) return best;
  let lowest = Number.POSITIVE_INFINITY;
  for (let low = kOutermost; low <= kInnermost; ++low) {
    for (let high = 100 - kOutermost; high >= 100 - kInnermost; --high) {
      const length = Math.max(at(high) - at(low), least);
      const cost = Math.log(length) - kWorth * Math.log((high - low) / 100);
      if (cost >= lowest) continue;
      lowest = cost;
      best = [at(low), at(high)];
    }
  }
  return best;
}

/**
 * The box that a picture of points should show, axis by axis, each time of the points within the other axes; the path
 * of the camera is in it. null without points.
 */
export function busyBox(points: readonly Vec3[], path: readonly Vec3[]): { low: Vec3; high: Vec3 } | null {
  if (points.length === 0) return null;
  const low = [-Infinity, -Infinity, -Infinity] as [number, number, number];
  const high = [Infinity, Infinity, Infinity] as [number, number, number];
  for (let round = 0; round < 2; ++round) {
    for (const axis of [0, 1, 2] as const) {
      const others = ([0, 1, 2] as const).filter((k) => k !== axis);
      const inside = points.filter((p) => others.every((k) => p[k] >= low[k] && p[k] <= high[k]));
      if (inside.length > 0) [low[axis], high[axis]] = busyStretch(inside.map((p) => p[axis]));
    }
  }
  for (const place of path) {
    for (const axis of [0, 1, 2] as const) {
      low[axis] = Math.min(low[axis], place[axis]);
      high[axis] = Math.max(high[axis], place[axis]);
    }
  }
  return { low, high };
}

/** Half of the height that a plan shows, so that the box fills it. `aspect`: width / height of the picture. */
export const planHalf = (low: Vec3, high: Vec3, aspect: number): number =>
  Math.max(0.6 * (high[1] - low[1]), (0.6 * (high[0] - low[0])) / aspect, 1e-6);

/** From which distance a picture 60 degrees high shows all of what is `extent` across. */
export const viewDistance = (extent: number, aspect: number): number => (0.87 * extent) / Math.min(aspect, 1);
