// SPDX-License-Identifier: BSD-2-Clause
// Which part of a cloud a picture should show. report/pictures.cpp does the same for the pictures of --preview.
import { type Vec3, add, basisAround, cross, dot, times, unit } from "./geometry";

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

/** Half of the height that a plan shows, so that the box fills 85 % of it. `aspect`: width / height of the picture. */
export const planHalf = (low: Vec3, high: Vec3, aspect: number): number =>
  Math.max(high[1] - low[1], (high[0] - low[0]) / aspect, 1e-6) / (2 * 0.85);

/**
 * The horizontal direction of most walls, from normals; null where no direction (and those across it) stands out. Of
 * the two axes of a building either may be meant.
 */
export function wallDirection(normals: Iterable<Vec3>, up: Vec3): Vec3 | null {
  const [a, b] = basisAround(up, [1, 0, 0]);
  const kBins = 90; // of a degree
  const kReach = 4;
  const angles: number[] = [];
  const counts = new Array<number>(kBins).fill(0);
  for (const normal of normals) {
    const [x, y] = [dot(normal, a), dot(normal, b)];
    if (x * x + y * y < 0.9) continue;
    const angle = ((Math.atan2(y, x) * 180) / Math.PI + 360) % kBins;
    angles.push(angle);
    counts[Math.floor(angle) % kBins]! += 1;
  }
  const sums = counts.map((_, bin) => {
    let sum = 0;
    for (let off = -kReach; off <= kReach; ++off) sum += counts[(bin + off + kBins) % kBins]!;
    return sum;
  });
  const best = sums.indexOf(Math.max(...sums));
  if (angles.length < 100 || sums[best]! < (2.5 * (2 * kReach + 1) * angles.length) / kBins) return null;
  const offs = angles.map((angle) => ((angle - best - 0.5 + 1.5 * kBins) % kBins) - kBins / 2).filter((off) => Math.abs(off) <= kReach);
  const angle = ((best + 0.5 + offs.reduce((sum, off) => sum + off, 0) / Math.max(offs.length, 1)) * Math.PI) / 180;
  return add(times(a, Math.cos(angle)), times(b, Math.sin(angle)));
}

/** Along the walls that normals show, the first axis as near to the path as they allow; without walls along the path. */
export function straightBasis(up: Vec3, path: Vec3, normals: Iterable<Vec3>): [Vec3, Vec3, Vec3] {
  const wall = wallDirection(normals, up);
  if (!wall) return basisAround(up, path);
  const across = cross(unit(up), wall);
  return basisAround(up, Math.abs(dot(wall, path)) >= Math.abs(dot(across, path)) ? wall : across);
}

/** Position and size of what is seen, as Cameras needs them: [-1, 1] fills the frame. */
interface Seen {
  middle: [number, number];
  half: number;
}

/** `places`: in the frame. 0.2 % at either end are ignored. */
export function seenOf(places: readonly (readonly [number, number])[]): Seen {
  const ends = [0, 1].map((k) => {
    const values = places.map((p) => p[k as 0]).sort((a, b) => a - b);
    const at = (share: number): number => values[Math.round(share * (values.length - 1))] ?? 0;
    return [at(0.002), at(0.998)] as const;
  });
  const [x, y] = [ends[0] ?? [0, 0], ends[1] ?? [0, 0]];
  return { middle: [(x[0] + x[1]) / 2, (y[0] + y[1]) / 2], half: Math.max(x[1] - x[0], y[1] - y[0], 1e-6) / 2 };
}
