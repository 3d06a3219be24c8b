// SPDX-License-Identifier: BSD-2-Clause
// What can be measured between points, and how far off it may be.
import { add, cross, dot, eigenvalues, norm, sub, thinnest, times, unit, type Vec3 } from "./geometry";

export type Kind = "distance" | "height" | "angle" | "area";
/** Quantity of a measurement; horizontal: part of a distance or height across `up`. */
type Quantity = Kind | "horizontal";

/** Points that a measurement takes; an area takes any number from three. */
export const pointsOf: Record<Kind, number> = { distance: 2, height: 2, angle: 3, area: 3 };

/** A point of the cloud. */
export interface Found {
  position: Vec3;
  /** 0 to 1 */
  confidence: number;
  /** Index of the keyframe; -1 = unknown. */
  keyframe: number;
}

/** A point of the cloud that was picked. */
export interface Picked extends Found {
  /** How far off what lies around it lets it be, in any direction [unit, 95 %]; see spreadOf. */
  spread: number;
}

/** A point that was just picked, with what ends around it. */
export interface Taken extends Picked {
  /** How far in front of it that begins which ends beside it [unit]; 0 = nothing. */
  front: number;
  /** How far from it, in front or behind, the surfaces are beside which it ends itself [unit]; 0 = it does not end. */
  rim: number;
}

/** What lies around a point. */
export interface Surroundings {
  /** Points within `radius` [unit], itself among them. */
  near: readonly Vec3[];
  radius: number;
  /** From where it was clicked [unit]. */
  off: number;
  /** How far in front of it that begins which ends beside it, seen from where one clicked [unit]; 0 = nothing. */
  gap: number;
}

// How far off a point may be was measured with clicks on corners, edges and walls of synthetic rooms
// (tests/measure.study.ts). It has five parts, each what 95 % stay below:
//
// - Along the ray from its camera, as its confidence says. Half of the depths are off by less than r. Were errors
//   normal, 95 % were below 2.9 r; where confidence is low they have far heavier tails, since what is matched there may
//   be something else altogether.
// - Edges and corners are rounded off by about half a patch, always to the same side. How much follows from how far the
//   points around are from one plane, with patches of the sizes that presets have.
// - Points have a spacing, and the place that is meant lies between them.
// - The point that was taken lies beside the click.
// - Silhouettes lack points, so that a click at the corner of a table falls on the floor behind it. Where something
//   ends beside the click, nobody knows which of the two was meant.

/** Around a point [pixels of the depth map]: what is looked at, about as far as patches reach. */
export const kRadiusPixels = 6;
/** With fewer points it looks farther. */
export const kFewPoints = 12;
/** What ends within so many pixels may have been meant; where depth maps drop silhouettes they drop some two to four. */
export const kBesidePixels = 5;
/** What is as many pixels in front is something else. */
export const kStepPixels = 8;
/** Of the thickness of what lies around. */
const kRounded = 5;
/** Of the spacing. */
const kBetween = 0.7;
/** Of the step in depth: it is known from points, which are uncertain, too. */
const kStep = 1.3;

/** How far off what lies around a point lets it be, in any direction [unit, 95 %]. */
export function spreadOf({ near, radius, off, gap }: Surroundings): number {
  const thickness = near.length > 3 ? thinnest(near).thickness : 0;
  const spacing = radius * Math.sqrt(Math.PI / Math.max(near.length, 1));
  return Math.hypot(kRounded * thickness, kBetween * spacing, off, kStep * gap);
}

/** The same of a point that was moved to planes, which are known to `fit`; `isWhole`: to one plane. */
export function spreadOnPlanes({ front, rim }: Taken, fit: number, isWhole: boolean): number {
  return Math.hypot(fit, kStep * (isWhole ? Math.max(front, rim) : front));
}

/** What 95 % are off by less than, squared, as a symmetric 3 x 3 matrix, row by row [unit^2]. */
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
/** From there on tails double it [share]. */
const kHeavy = 0.03;

/** What 95 % of the depths with this confidence are off by less than, as a share of themselves. */
export function depthError95(confidence: number): number {
  const normal = k95 * Math.max(relativeError(confidence), kBest);
  return normal * (1 + normal / kHeavy);
}

/**
 * Along the ray from its keyframe's camera a point is as uncertain as its confidence says; and in each direction as what
 * lies around it says. Without a camera it is the same in all directions, seen from `reach` away.
 */
export function covarianceOf(point: Picked, camera: Vec3 | null, reach: number): Covariance {
  const ray = camera ? sub(point.position, camera) : ([0, 0, reach] as Vec3);
  const around = point.spread ** 2;
  const along = (norm(ray) * depthError95(point.confidence)) ** 2 + around;
  const across = camera ? around : along;
  const r = unit(ray);
  const matrix: number[] = [];
  for (const i of [0, 1, 2] as const) {
    for (const k of [0, 1, 2] as const) matrix.push((along - across) * r[i] * r[k] + (i === k ? across : 0));
  }
  return matrix;
}

/** As long as the measurement. Of an angle: sum (`isWide`) or difference of the directions of its sides. */
function vectorOf(kind: Quantity, points: readonly Vec3[], up: Vec3, isWide = false): Vec3 {
  const [a, b, c] = points;
  if (!a || !b) return [0, 0, 0];
  const height = times(up, dot(sub(b, a), up));
  if (kind === "distance") return sub(b, a);
  if (kind === "height") return height;
  if (kind === "horizontal") return sub(sub(b, a), height);
  if (!c) return [0, 0, 0];
  if (kind === "angle") return (isWide ? add : sub)(unit(sub(a, b)), unit(sub(c, b)));
  let sum: Vec3 = [0, 0, 0];
  for (let i = 1; i + 1 < points.length; ++i) {
    sum = add(sum, cross(sub(points[i] ?? a, a), sub(points[i + 1] ?? a, a)));
  }
  return times(sum, 0.5);
}

/** In degrees for an angle, square units for an area. */
export function valueOf(kind: Quantity, points: readonly Vec3[], up: Vec3): number {
  if (kind !== "angle") return norm(vectorOf(kind, points, up));
  return (2 * Math.atan2(norm(vectorOf(kind, points, up)), norm(vectorOf(kind, points, up, true))) * 180) / Math.PI;
}

const powerOf = (kind: Quantity): number => (kind === "angle" ? 0 : kind === "area" ? 2 : 1);

/**
 * What 95 % of such measurements are off by less than, to first order, if the points' errors have nothing in common.
 * Where the vector of the measurement is 0, errors in any direction count.
 */
export function errorOf(kind: Quantity, points: readonly Vec3[], covariances: readonly Covariance[], up: Vec3): number {
  const center = times(
    points.reduce((sum, p) => add(sum, p), [0, 0, 0] as Vec3),
    1 / Math.max(points.length, 1),
  );
  const size = Math.max(...points.map((p) => norm(sub(p, center)))) || 1;
  const step = 1e-4 * size;
  const half = kind === "angle" ? (valueOf(kind, points, up) * Math.PI) / 360 : 0;
  const isWide = half > Math.PI / 4;
  const matrix = new Array<number>(9).fill(0);
  points.forEach((point, which) => {
    const slopes = [0, 1, 2].map((axis) => {
      const moved = (by: number): Vec3 => {
        const all = points.slice();
        all[which] = add(point, [axis === 0 ? by : 0, axis === 1 ? by : 0, axis === 2 ? by : 0]);
        return vectorOf(kind, all, up, isWide);
      };
      return times(sub(moved(step), moved(-step)), 1 / (2 * step));
    });
    covariances[which]?.forEach((c, n) => {
      const [u, v] = [slopes[Math.floor(n / 3)]!, slopes[n % 3]!];
      for (let i = 0; i < 9; ++i) matrix[i]! += c * u[Math.floor(i / 3) as 0] * v[(i % 3) as 0];
    });
  });
  const vector = vectorOf(kind, points, up, isWide);
  const along = unit(vector);
  const variance =
    norm(vector) > 1e-4 * size ** powerOf(kind)
      ? matrix.reduce((sum, x, i) => sum + x * along[Math.floor(i / 3) as 0] * along[(i % 3) as 0], 0)
      : eigenvalues(matrix)[1];
  const error = Math.sqrt(Math.max(variance, 0));
  return kind === "angle" ? ((error / (isWide ? Math.sin(half) : Math.cos(half))) * 180) / Math.PI : error;
}

/** "1.234 ± 0.012 m": as many digits as the error leaves. */
export function measureText(kind: Kind, value: number, error: number, unitName: string): string {
  const digits = Math.max(0, Math.min(6, error > 0 ? 1 - Math.floor(Math.log10(error)) : 3));
  const what = kind === "angle" ? "°" : kind === "area" ? ` ${unitName}²` : ` ${unitName}`;
  return `${value.toFixed(digits)} ± ${error.toFixed(digits)}${what}`;
}

/** Unit that lengths are shown in. */
export interface Scale {
  unit: string;
  /** Of a length of the page. */
  factor: number;
  /** Of the factor [95 %]. */
  relativeError: number;
}

export const unscaled = (unit: string): Scale => ({ unit, factor: 1, relativeError: 0 });

export interface Valued {
  value: number;
  /** 95 % bound. */
  error: number;
}
export interface Result extends Valued {
  text: string;
  /** Of a distance or a height. */
  parts?: { horizontal: Valued; vertical: Valued };
}

/** Context of a measurement. `camera`: position of a keyframe's camera; null = unknown. */
export interface About {
  up: Vec3;
  scale: Scale;
  reach: number;
  camera: (keyframe: number) => Vec3 | null;
}

/** What a measurement says. */
export function resultOf(it: { kind: Kind; points: Picked[] }, about: About): Result {
  const places = it.points.map((p) => p.position);
  const covariances = it.points.map((p) => covarianceOf(p, about.camera(p.keyframe), about.reach));
  const { factor, relativeError, unit } = about.scale;
  const valued = (kind: Quantity): Valued => {
    const power = powerOf(kind);
    const value = valueOf(kind, places, about.up);
    const error = Math.hypot(errorOf(kind, places, covariances, about.up), power * relativeError * value);
    return { value: factor ** power * value, error: factor ** power * error };
  };
  const whole = valued(it.kind);
  const result = { ...whole, text: measureText(it.kind, whole.value, whole.error, unit) };
  if (it.kind !== "distance" && it.kind !== "height") return result;
  return { ...result, parts: { horizontal: valued("horizontal"), vertical: valued("height") } };
}
