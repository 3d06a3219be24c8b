// SPDX-License-Identifier: BSD-2-Clause
// What can be measured between points, and how far off it may be.
import { add, cross, dot, norm, sub, times, unit, type Vec3 } from "./geometry";

export type Kind = "distance" | "height" | "angle" | "area";

/** Points that a measurement takes; an area takes any number from three. */
export const pointsOf: Record<Kind, number> = { distance: 2, height: 2, angle: 3, area: 3 };

/** A point of the cloud that was picked. */
export interface Picked {
  position: Vec3;
  /** 0 to 1 */
  confidence: number;
  /** Place among the keyframes; -1 = nobody knows. */
  keyframe: number;
}

/** Where a point may truly be, as a symmetric 3 x 3 matrix, row by row [unit^2]. */
type Covariance = readonly number[];

/** What c means: half of the depths are off by less than this share of themselves. As pmsp::DepthMap says. */
export function relativeError(confidence: number): number {
  const c = Math.max(Math.min(confidence, 1), 0.004);
  return (0.005 * (1 - c)) / c;
}

/** From the error that half stay below to the one that 95 % stay below, of a normal distribution. */
const k95 = 1.96 / 0.6745;
/** No depth is known better than that, whatever its confidence says [share]. */
const kBest = 0.0005;

/**
 * Along the ray from its keyframe's camera a point is as uncertain as its confidence says; and in each direction by a
 * pixel of the depth map, since patches round edges and corners off by about that. Without a camera the same in all
 * directions, seen from `reach` away.
 */
export function covarianceOf(point: Picked, camera: Vec3 | null, pixel: number, reach: number): Covariance {
  const ray = camera ? sub(point.position, camera) : ([0, 0, reach] as Vec3);
  const depth = norm(ray);
  const rounded = (depth * pixel) ** 2;
  const along = (depth * Math.max(relativeError(point.confidence), kBest)) ** 2 + rounded;
  const across = camera ? rounded : along;
  const r = unit(ray);
  const matrix: number[] = [];
  for (const i of [0, 1, 2] as const) {
    for (const k of [0, 1, 2] as const) matrix.push((along - across) * r[i] * r[k] + (i === k ? across : 0));
  }
  return matrix;
}

/** In degrees for an angle, square units for an area. */
export function valueOf(kind: Kind, points: readonly Vec3[], up: Vec3): number {
  const [a, b, c] = points;
  if (!a || !b) return 0;
  if (kind === "distance") return norm(sub(b, a));
  if (kind === "height") return Math.abs(dot(sub(b, a), up));
  if (!c) return 0;
  if (kind === "angle") {
    const u = sub(a, b);
    const v = sub(c, b);
    return (Math.atan2(norm(cross(u, v)), dot(u, v)) * 180) / Math.PI;
  }
  let sum: Vec3 = [0, 0, 0];
  for (let i = 1; i + 1 < points.length; ++i) {
    sum = add(sum, cross(sub(points[i] ?? a, a), sub(points[i + 1] ?? a, a)));
  }
  return norm(sum) / 2;
}

/** What 95 % of such measurements are off by less than, to first order, if the points' errors have nothing in common. */
export function errorOf(kind: Kind, points: readonly Vec3[], covariances: readonly Covariance[], up: Vec3): number {
  const center = times(
    points.reduce((sum, p) => add(sum, p), [0, 0, 0] as Vec3),
    1 / Math.max(points.length, 1),
  );
  const size = Math.max(...points.map((p) => norm(sub(p, center))), 1e-12);
  const step = 1e-4 * size;
  let variance = 0;
  points.forEach((point, which) => {
    const gradient = [0, 1, 2].map((axis) => {
      const moved = (by: number): number => {
        const all = points.slice();
        all[which] = add(point, [axis === 0 ? by : 0, axis === 1 ? by : 0, axis === 2 ? by : 0]);
        return valueOf(kind, all, up);
      };
      return (moved(step) - moved(-step)) / (2 * step);
    });
    const c = covariances[which] ?? [];
    for (let i = 0; i < 3; ++i) {
      for (let k = 0; k < 3; ++k) variance += (gradient[i] ?? 0) * (c[3 * i + k] ?? 0) * (gradient[k] ?? 0);
    }
  });
  return k95 * Math.sqrt(Math.max(variance, 0));
}

/** "1.234 ± 0.012 m": as many digits as the error leaves. */
export function measureText(kind: Kind, value: number, error: number, unitName: string): string {
  const digits = Math.max(0, Math.min(6, error > 0 ? 1 - Math.floor(Math.log10(error)) : 3));
  const what = kind === "angle" ? "°" : kind === "area" ? ` ${unitName}²` : ` ${unitName}`;
  return `${value.toFixed(digits)} ± ${error.toFixed(digits)}${what}`;
}

export interface Result {
  value: number;
  error: number;
  text: string;
}

/** What a measurement says. `camera`: where that of a keyframe stood; null = nobody knows. */
export function resultOf(
  it: { kind: Kind; points: Picked[] },
  about: { up: Vec3; unit: string; pixel: number; reach: number; camera: (keyframe: number) => Vec3 | null },
): Result {
  const places = it.points.map((p) => p.position);
  const covariances = it.points.map((p) => covarianceOf(p, about.camera(p.keyframe), about.pixel, about.reach));
  const value = valueOf(it.kind, places, about.up);
  const error = errorOf(it.kind, places, covariances, about.up);
  return { value, error, text: measureText(it.kind, value, error, about.unit) };
}
