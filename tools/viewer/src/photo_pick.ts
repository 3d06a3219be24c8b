// SPDX-License-Identifier: BSD-2-Clause
// Picking in a photo: the depth of that keyframe at that pixel.
import { type Depths, placeAt } from "./depths";
import { type Pose, type Vec3, add, fromCamera, norm, sub, toCamera, unit } from "./geometry";
import { type Taken, kBesidePixels, kFewPoints, kRadiusPixels, kStepPixels, spreadOf } from "./measure";
import { stepIn } from "./surroundings";

export interface Photo {
  depths: Depths;
  /** From the page's origin. */
  pose: Pose;
  /** Index of the keyframe. */
  keyframe: number;
  lensDistance: number;
}

/** No depth at the pixel, or that of no surface around it. */
export const kNoDepth = "This photo has no depth here; click beside it, or open another photo.";
/** Beside the pixel it is unknown how far the surface goes. */
export const kOpenEdge = "The surface ends here, and what is behind it is unknown; click a little inside it.";

/** A hole is closed from pixels so near to it that agree all around. */
const kHolePixels = 3;
/** A depth counts with so many of the eight pixels around on its surface. */
const kSupport = 3;
/** Beyond so many pixels without a depth it is unknown what ends at a pixel. */
const kAcrossPixels = 5;
/** Share of the difference to the next pixel: a click is exact to less than a pixel. */
const kSlope = 0.7;

const directions = Array.from({ length: 8 }, (_, k): [number, number] => [Math.cos((k * Math.PI) / 4), Math.sin((k * Math.PI) / 4)]);

/** Pixel whose depth a click takes, with the distance of the click from it [px]. */
interface Chosen {
  column: number;
  row: number;
  off: number;
}

/** Depths that differ by less are of one surface. */
const stepAt = (depths: Depths, depth: number): number => kStepPixels * depths.pixel * depth;

function pixelOf(depths: Depths, column: number, row: number): Chosen | null {
  const [x, y] = [Math.floor(column), Math.floor(row)];
  const here = depths.at(x, y);
  if (here > 0) {
    let support = -1; // itself
    depths.around(x + 0.5, y + 0.5, 1.5, (c, r) => {
      const depth = depths.at(c, r);
      if (depth > 0 && Math.abs(depth - here) <= stepAt(depths, here)) ++support;
    });
    if (support >= kSupport) return { column: x, row: y, off: 0.5 };
  }
  let best: Chosen | null = null;
  let [low, high] = [Number.POSITIVE_INFINITY, 0];
  const sides = new Set<number>();
  depths.around(column, row, kHolePixels, (c, r) => {
    const depth = depths.at(c, r);
    if (depth === 0 || (c === x && r === y)) return;
    [low, high] = [Math.min(low, depth), Math.max(high, depth)];
    sides.add((c + 0.5 < column ? 0 : 1) + (r + 0.5 < row ? 0 : 2));
    const shrink = Math.max(Math.cos((0.5 - (r + 0.5) / depths.height) * Math.PI), 1e-3);
    const off = Math.hypot((c + 0.5 - column) * shrink, r + 0.5 - row);
    if (!best || off < best.off) best = { column: c, row: r, off };
  });
  return sides.size >= 3 && high - low <= stepAt(depths, low) ? best : null;
}

/** What lies beside a pixel: how far the next surfaces are in front or behind, and the slope; null = it is unknown. */
function besides(depths: Depths, { column, row }: Chosen): { gap: number; slope: number } | null {
  const depth = depths.at(column, row);
  const step = stepAt(depths, depth);
  const shrink = Math.max(Math.cos((0.5 - (row + 0.5) / depths.height) * Math.PI), 1 / depths.width);
  let [gap, slope, open] = [0, 0, 0];
  for (const [right, down] of directions) {
    let isOpen = true;
    for (let s = 1; s <= kAcrossPixels && isOpen; ++s) {
      const there = depths.at(column + Math.round((s * right) / shrink), row + Math.round(s * down));
      if (there === 0) continue;
      isOpen = false;
      const off = Math.abs(there - depth);
      if (off > step) gap = Math.max(gap, off);
      else if (s === 1) slope = Math.max(slope, off);
    }
    if (isOpen) ++open;
  }
  return open < 2 ? { gap, slope } : null;
}

/** Surface that the photo shows in a direction of the page, or why it is unknown. */
export function pickedInPhoto(photo: Photo, direction: Vec3): Taken | string {
  const { depths, pose, lensDistance } = photo;
  const ray = unit(toCamera(pose, direction));
  const [column, row] = depths.placeOf(ray);
  const taken = pixelOf(depths, column, row);
  if (!taken) return kNoDepth;
  const beside = besides(depths, taken);
  if (!beside) return kOpenEdge;
  const depth = depths.at(taken.column, taken.row);
  const place = placeAt(ray, depth, lensDistance);
  const pixel = depths.pixel * depth;
  let radius = kRadiusPixels * pixel;
  const near: Vec3[] = [];
  const gaps: number[] = [];
  depths.around(column, row, kRadiusPixels, (c, r) => {
    const here = depths.at(c, r);
    if (here === 0) return;
    const at = placeAt(depths.rayOf(c, r), here, lensDistance);
    if (norm(sub(at, place)) <= radius) near.push(at);
  });
  depths.around(column, row, kBesidePixels, (c, r) => {
    const here = depths.at(c, r);
    if (here > 0 && here <= depth) gaps.push(depth - here);
  });
  if (near.length < kFewPoints) radius *= 2;
  const front = stepIn(gaps, kStepPixels * pixel);
  const gap = Math.max(front, beside.gap);
  const spread = spreadOf({ near, radius, off: Math.hypot(taken.off * pixel, kSlope * beside.slope), gap });
  return {
    position: add(pose.center, fromCamera(pose, place)),
    confidence: depths.confidenceAt(taken.column, taken.row),
    keyframe: photo.keyframe,
    spread,
    front,
    rim: beside.gap,
  };
}

/** Places of the depth map's pixels around one of its places, as far from it as `radius` pixels. */
export function placesInPhoto({ depths, pose, lensDistance }: Photo, position: Vec3, radius: number): Vec3[] {
  const place = toCamera(pose, sub(position, pose.center));
  const most = radius * depths.pixel * norm(place);
  const found: Vec3[] = [];
  depths.around(...depths.placeOf(place), radius, (c, r) => {
    const depth = depths.at(c, r);
    if (depth === 0) return;
    const at = placeAt(depths.rayOf(c, r), depth, lensDistance);
    if (norm(sub(at, place)) <= most) found.push(add(pose.center, fromCamera(pose, at)));
  });
  return found;
}
