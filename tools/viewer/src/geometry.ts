// SPDX-License-Identifier: BSD-2-Clause
// Vectors, and the conventions of libpmsp: camera axes +x right, +y down, +z forward; longitude = atan2(x, z),
// latitude = -asin(y / |p|); columns of a panorama grow with longitude, rows downward.

export type Vec3 = readonly [number, number, number];

export const add = (a: Vec3, b: Vec3): Vec3 => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const sub = (a: Vec3, b: Vec3): Vec3 => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const times = (a: Vec3, s: number): Vec3 => [a[0] * s, a[1] * s, a[2] * s];
export const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a: Vec3, b: Vec3): Vec3 => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
export const norm = (a: Vec3): number => Math.hypot(a[0], a[1], a[2]);
export const unit = (a: Vec3): Vec3 => {
  const length = norm(a);
  return length > 0 ? times(a, 1 / length) : [0, 0, 1];
};

/** Where a camera stood and how it was turned. */
export interface Pose {
  center: Vec3;
  /** cam_from_file, row by row. */
  rotation: readonly number[];
}

/** A direction of the cloud's frame in the axes of the camera. */
export function toCamera(pose: Pose, direction: Vec3): Vec3 {
  const r = pose.rotation;
  const row = (i: number): number => dot([r[i] ?? 0, r[i + 1] ?? 0, r[i + 2] ?? 0], direction);
  return [row(0), row(3), row(6)];
}

/** A direction of the camera's axes in the cloud's frame. */
export function fromCamera(pose: Pose, direction: Vec3): Vec3 {
  const r = pose.rotation;
  const column = (i: number): number => dot([r[i] ?? 0, r[i + 3] ?? 0, r[i + 6] ?? 0], direction);
  return [column(0), column(1), column(2)];
}

/** Where a direction of the camera shows in its panorama: shares of width and height, from the upper left corner. */
export function panoramaPlace(direction: Vec3): [number, number] {
  const longitude = Math.atan2(direction[0], direction[2]);
  const latitude = -Math.asin(Math.max(-1, Math.min(1, direction[1] / norm(direction))));
  return [0.5 + longitude / (2 * Math.PI), 0.5 - latitude / Math.PI];
}

/** Two axes across `up`, so that (first, second, up) is right-handed; the first one as near to `along` as can be. */
export function basisAround(up: Vec3, along: Vec3): [Vec3, Vec3, Vec3] {
  const third = unit(up);
  let first = sub(along, times(third, dot(along, third)));
  if (norm(first) < 1e-9 * norm(along) || norm(first) === 0) {
    const other: Vec3 = Math.abs(third[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0];
    first = sub(other, times(third, dot(other, third)));
  }
  first = unit(first);
  return [first, cross(third, first), third];
}

/** The direction in which places spread most, across `up`. */
export function mainDirection(places: readonly Vec3[], up: Vec3): Vec3 {
  const [a, b] = basisAround(up, [1, 0, 0]);
  const flat = places.map((p) => [dot(p, a), dot(p, b)] as const);
  const mean = (k: 0 | 1): number => flat.reduce((sum, p) => sum + p[k], 0) / Math.max(flat.length, 1);
  const ma = mean(0);
  const mb = mean(1);
  let aa = 0;
  let ab = 0;
  let bb = 0;
  for (const [x, y] of flat) {
    aa += (x - ma) ** 2;
    ab += (x - ma) * (y - mb);
    bb += (y - mb) ** 2;
  }
  const angle = 0.5 * Math.atan2(2 * ab, aa - bb);
  return add(times(a, Math.cos(angle)), times(b, Math.sin(angle)));
}

/** Points lie around `center`, least far along `normal`: `thickness` is what they are off from the plane (root of the mean square). */
interface Slab {
  center: Vec3;
  normal: Vec3;
  thickness: number;
}

/** The smallest and the largest eigenvalue of a symmetric 3 x 3 matrix, row by row (Smith 1961). */
export function eigenvalues([xx = 0, xy = 0, xz = 0, , yy = 0, yz = 0, , , zz = 0]: readonly number[]): [number, number] {
  const mean = (xx + yy + zz) / 3;
  const p = Math.sqrt(((xx - mean) ** 2 + (yy - mean) ** 2 + (zz - mean) ** 2 + 2 * (xy * xy + xz * xz + yz * yz)) / 6);
  const [a, b, c]: [Vec3, Vec3, Vec3] = [[xx - mean, xy, xz], [xy, yy - mean, yz], [xz, yz, zz - mean]];
  const half = p > 0 ? dot(a, cross(b, c)) / (2 * p ** 3) : 0;
  const angle = Math.acos(Math.max(-1, Math.min(1, half))) / 3;
  return [mean + 2 * p * Math.cos(angle + (2 * Math.PI) / 3), mean + 2 * p * Math.cos(angle)];
}

/** The plane that fits points best, and how far they are off. Of fewer than three: a plane through them. */
export function thinnest(points: readonly Vec3[]): Slab {
  const count = Math.max(points.length, 1);
  const center = times(points.reduce((sum, p) => add(sum, p), [0, 0, 0] as Vec3), 1 / count);
  let [xx, xy, xz, yy, yz, zz] = [0, 0, 0, 0, 0, 0];
  for (const p of points) {
    const [x, y, z] = sub(p, center);
    [xx, xy, xz] = [xx + (x * x) / count, xy + (x * y) / count, xz + (x * z) / count];
    [yy, yz, zz] = [yy + (y * y) / count, yz + (y * z) / count, zz + (z * z) / count];
  }
  if (!(xx + yy + zz > 0)) return { center, normal: [0, 0, 1], thickness: 0 };
  const [least] = eigenvalues([xx, xy, xz, xy, yy, yz, xz, yz, zz]);
  // Rows of what is left span the plane.
  const rows: Vec3[] = [[xx - least, xy, xz], [xy, yy - least, yz], [xz, yz, zz - least]];
  const normals = rows.map((row, i) => cross(row, rows[(i + 1) % 3] ?? row)).sort((u, v) => norm(v) - norm(u));
  return { center, normal: unit(normals[0] ?? [0, 0, 1]), thickness: Math.sqrt(Math.max(least, 0)) };
}

/** A normal from the two signed bytes that the page holds (octahedral). */
export function normalFrom(a: number, b: number): Vec3 {
  const u = a / 127;
  const v = b / 127;
  const w = 1 - Math.abs(u) - Math.abs(v);
  const fold = Math.max(-w, 0);
  return unit([u + (u >= 0 ? -fold : fold), v + (v >= 0 ? -fold : fold), w]);
}

/** The same two bytes from a normal. */
export function octahedral(normal: Vec3): [number, number] {
  const length = Math.abs(normal[0]) + Math.abs(normal[1]) + Math.abs(normal[2]);
  if (!(length > 0)) return [0, 0];
  const [u, v] = [normal[0] / length, normal[1] / length];
  const folded: [number, number] = [(1 - Math.abs(v)) * (u < 0 ? -1 : 1), (1 - Math.abs(u)) * (v < 0 ? -1 : 1)];
  const [a, b] = normal[2] < 0 ? folded : [u, v];
  return [Math.round(127 * a), Math.round(127 * b)];
}

/** 1, 2 or 5 times a power of ten: the largest that is not above `most`. */
export function roundLength(most: number): number {
  if (!(most > 0)) return 1;
  const power = 10 ** Math.floor(Math.log10(most));
  for (const step of [5, 2, 1]) if (step * power <= most * (1 + 1e-12)) return step * power;
  return power;
}
