// SPDX-License-Identifier: BSD-2-Clause
// Snapping: the planes around a point that was picked, and the edge or corner where they meet.
import { type Vec3, add, cross, dot, norm, sub, thinnest, times, unit } from "./geometry";

export type SnapKind = "plane" | "edge" | "corner";

interface Snapped {
  kind: SnapKind;
  position: Vec3;
  /** Of the place, by how far the planes' points are from them [unit, 95 %]. */
  spread: number;
}

interface Plane {
  normal: Vec3;
  center: Vec3;
  points: Vec3[];
  /** Root of the mean square of the points' distances. */
  thickness: number;
}

/** Around a point [pixels of the depth map]: from where planes are fitted. Farther than patches round edges off. */
export const kSnapPixels = 16;
/** To where a corner or an edge draws [pixels of the depth map]. */
const kDraws = 4;
const kMostPoints = 800;
const kTrials = 150;
/** A plane has so many points, and so large a share of all. */
const kFewest = 24;
const kLeastShare = 0.12;
/** Points of a plane are so near to it, times the median. */
const kClose = 3;
/** So near to another plane points are rounded off [pixels]. */
const kRoundedPixels = 5;
/** Cosine between planes that meet at an edge. */
const kFlat = 0.9;
/** Points of a depth map are not independent of those as far as a patch reaches: of so many one counts. */
const kAlike = 20;
/** A place is not known better than that [pixels]. */
const kLeastSpread = 0.5;
/** Nor a corner [pixels], and half as well as it is away from the point that was picked. */
const kLeastCorner = 2;
/** Nor a place on an edge [pixels], and as well as it is away: what was picked may have been meant. */
const kLeastEdge = 3;
/** A point snaps to a plane where such a share of the points so near to it lies on it [pixels]. */
const kAroundPixels = 7;
const kMostOn = 0.9;

const distanceTo = (plane: Pick<Plane, "normal" | "center">, p: Vec3): number => Math.abs(dot(plane.normal, sub(p, plane.center)));

function planeOf(points: Vec3[]): Plane {
  const { normal, center, thickness } = thinnest(points);
  return { normal, center, points, thickness };
}

/** Without points that are rounded off. */
function refined(plane: Plane, others: readonly Plane[], pixel: number): Plane {
  const inner = plane.points.filter((p) => others.every((it) => it === plane || distanceTo(it, p) > kRoundedPixels * pixel));
  return inner.length >= kFewest ? planeOf(inner) : plane;
}

/** Planes of points, the largest first (MSAC: Torr and Zisserman 2000). The same for the same points. */
export function planesOf(points: readonly Vec3[], pixel: number): Plane[] {
  const tolerance = pixel;
  const stride = Math.max(1, points.length / kMostPoints);
  let left: Vec3[] = [];
  for (let i = 0; i < points.length; i += stride) left.push(points[Math.floor(i)]!);
  const fewest = Math.max(kFewest, kLeastShare * left.length);
  const planes: Plane[] = [];
  let state = 1;
  const random = (): number => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32;
  while (planes.length < 3 && left.length >= fewest) {
    let best: Pick<Plane, "normal" | "center"> | null = null;
    let most = 0;
    for (let trial = 0; trial < kTrials; ++trial) {
      const [a, b, c] = [0, 1, 2].map(() => left[Math.floor(random() * left.length)]!) as [Vec3, Vec3, Vec3];
      const normal = cross(sub(b, a), sub(c, a));
      if (!(norm(normal) > 4 * tolerance * tolerance)) continue;
      const plane = { normal: unit(normal), center: a };
      const score = left.reduce((sum, p) => sum + Math.max(0, 1 - (distanceTo(plane, p) / tolerance) ** 2), 0);
      if (score > most) [most, best] = [score, plane];
    }
    if (!best) break;
    let on: Vec3[] = [];
    let close = tolerance;
    for (let round = 0; round < 8; ++round) {
      on = left.filter((p) => distanceTo(best!, p) <= close);
      const fit = thinnest(on);
      best = { normal: fit.normal, center: fit.center };
      // Edges are rounded off to one side, and not as often as the plane's own points lie off it.
      const offs = on.map((p) => distanceTo(best!, p)).sort((a, b) => a - b);
      close = Math.min(close, Math.max(kClose * (offs[offs.length >> 1] ?? 0), 0.1 * tolerance));
    }
    if (on.length < fewest) break;
    const plane = planeOf(on);
    if (planes.every((it) => Math.abs(dot(it.normal, plane.normal)) < kFlat)) planes.push(plane);
    // What bends between two planes belongs to neither.
    left = left.filter((p) => distanceTo(plane, p) > 2 * tolerance);
  }
  return planes.map((it) => refined(it, planes, pixel));
}

/** Error of a plane at its centre. */
const errorOf = (plane: Plane): number => 1.96 * (plane.thickness / Math.sqrt(Math.max(1, plane.points.length / kAlike)) + 0.25 * plane.thickness);

/**
 * Where the planes around a point meet, if that is near it, or the point of the plane it lies on; null = points around
 * lie on no plane. `along`: direction of the click. `pixel`: side of a pixel of the depth map there.
 */
export function snapped(points: readonly Vec3[], place: Vec3, along: Vec3, pixel: number): Snapped | null {
  const planes = planesOf(points, Math.max(pixel, 1e-12));
  const draws = kDraws * pixel;
  const least = kLeastSpread * pixel;
  const [a, b, c] = planes;
  const away = (p: Vec3): number => norm(sub(p, place));
  if (a && b && c) {
    const det = dot(a.normal, cross(b.normal, c.normal));
    if (Math.abs(det) > 0.3) {
      const heights = [a, b, c].map((it) => dot(it.normal, sub(it.center, place)));
      const [x, y, z] = [cross(b.normal, c.normal), cross(c.normal, a.normal), cross(a.normal, b.normal)].map((it, i) => times(it, (heights[i] ?? 0) / det)) as [Vec3, Vec3, Vec3];
      const position = add(place, add(x, add(y, z)));
      const spread = Math.hypot(kLeastCorner * pixel, 0.5 * away(position), Math.hypot(...[a, b, c].map(errorOf)) / Math.abs(det));
      if (away(position) <= draws) return { kind: "corner", position, spread };
    }
  }
  const pairs: [Plane, Plane][] = [];
  for (const [u, v] of [[a, b], [a, c], [b, c]]) if (u && v) pairs.push([u, v]);
  const edges = pairs.map(([u, v]): Snapped => {
    const cosine = dot(u.normal, v.normal);
    const square = 1 - cosine * cosine;
    const [hu, hv] = [dot(u.normal, sub(u.center, place)), dot(v.normal, sub(v.center, place))];
    const by = add(times(u.normal, (hu - cosine * hv) / square), times(v.normal, (hv - cosine * hu) / square));
    const position = add(place, by);
    return { kind: "edge", position, spread: Math.hypot(kLeastEdge * pixel, away(position), Math.hypot(errorOf(u), errorOf(v)) / Math.sqrt(square)) };
  });
  edges.sort((s, t) => away(s.position) - away(t.position));
  if (edges[0] && away(edges[0].position) <= draws) return edges[0];
  const around = points.filter((p) => away(p) <= kAroundPixels * pixel);
  const under = planes.find((it) => around.filter((p) => distanceTo(it, p) <= pixel).length >= kMostOn * around.length);
  if (!under || around.length === 0) return null;
  const slope = dot(under.normal, along);
  if (Math.abs(slope) < 0.15) return null;
  const position = add(place, times(along, dot(under.normal, sub(under.center, place)) / slope));
  if (away(position) > draws) return null;
  return { kind: "plane", position, spread: Math.hypot(least, errorOf(under) / Math.abs(slope)) };
}
