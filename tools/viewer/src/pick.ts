// SPDX-License-Identifier: BSD-2-Clause
// Which point of the cloud lies at a place of the picture.
import { type Camera, Matrix4 } from "three";
import type { Cloud, Cube } from "./cloud";
import { kNoKeyframe } from "./data";
import { type Vec3, norm, sub } from "./geometry";
import type { Found } from "./measure";
import { isPerspective } from "./sight";

/** Beside a click [px]. */
export const kPickRadius = 12;

/**
 * The point at a place of the picture: of those within `radius` pixels that lie in front, the one that is near and
 * well known. Snaps so to points, never to what lies between them.
 */
export function pick(cloud: Cloud, camera: Camera, x: number, y: number, width: number, height: number, radius: number): Found | null {
  const m = new Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
  const found: { depth: number; off: number; cube: Cube; i: number }[] = [];
  for (const cube of cloud.cubes) {
    const points = cube.points;
    if (!points) continue;
    const step = new Matrix4().makeScale(1 / 65535, 1 / 65535, 1 / 65535);
    const e = step.premultiply(cube.matrix).premultiply(m).elements;
    const [e0, e1, e3, e4, e5, e7] = [e[0]!, e[1]!, e[3]!, e[4]!, e[5]!, e[7]!];
    const [e8, e9, e11, e12, e13, e15] = [e[8]!, e[9]!, e[11]!, e[12]!, e[13]!, e[15]!];
    const positions = points.positions;
    for (let i = 0; i < points.count; ++i) {
      const px = positions[4 * i]!;
      const py = positions[4 * i + 1]!;
      const pz = positions[4 * i + 2]!;
      const w = e3 * px + e7 * py + e11 * pz + e15;
      if (w <= 1e-9) continue;
      const dx = ((e0 * px + e4 * py + e8 * pz + e12) / w + 1) * 0.5 * width - x;
      if (dx > radius || dx < -radius) continue;
      const dy = (1 - (e1 * px + e5 * py + e9 * pz + e13) / w) * 0.5 * height - y;
      if (dx * dx + dy * dy > radius * radius) continue;
      const depth = e[2]! * px + e[6]! * py + e[10]! * pz + e[14]!;
      const at = cloud.positionOf(cube, i);
      if (!cloud.isShown(camera, cube, i, at)) continue;
      found.push({ depth: isPerspective(camera) ? w : depth, off: Math.hypot(dx, dy), cube, i });
    }
  }
  if (found.length === 0) return null;
  const front = Math.min(...nearest(found, radius / 2).map((it) => it.depth));
  const slack = isPerspective(camera) ? 0.03 * front : 0.02;
  let best = found[0]!;
  let least = Number.POSITIVE_INFINITY;
  const confidences: number[] = [];
  for (const it of found) {
    if (it.depth > front + slack) continue;
    const confidence = (it.cube.points?.colors[4 * it.i + 3] ?? 0) / 255;
    confidences.push(confidence);
    const cost = it.off + 0.3 * radius * (1 - confidence);
    if (cost < least) {
      least = cost;
      best = it;
    }
  }
  // The most confident of many points is overestimated: limit it to the median confidence nearby.
  confidences.sort((a, b) => a - b);
  const usual = confidences[Math.floor(confidences.length / 2)] ?? 0;
  const point = pointOf(cloud, best.cube, best.i);
  if (point.keyframe < 0) point.keyframe = keyframeNear(cloud, point.position);
  return { ...point, confidence: Math.min(point.confidence, usual) };
}

/** Of the nearest point that the page itself holds: others do not say which keyframe made them. */
function keyframeNear(cloud: Cloud, position: Vec3): number {
  let keyframe = -1;
  let least = Number.POSITIVE_INFINITY;
  for (const cube of cloud.cubes) {
    for (let i = 0; i < (cube.held?.count ?? 0); ++i) {
      const here = cube.held?.keyframes[i] ?? kNoKeyframe;
      const off = norm(sub(cloud.positionOf(cube, i, cube.held), position));
      if (here === kNoKeyframe || off >= least) continue;
      least = off;
      keyframe = here;
    }
  }
  return keyframe;
}

function pointOf(cloud: Cloud, cube: Cube, i: number): Found {
  const keyframe = cube.points?.keyframes[i] ?? kNoKeyframe;
  return {
    position: cloud.positionOf(cube, i),
    confidence: (cube.points?.colors[4 * i + 3] ?? 0) / 255,
    keyframe: keyframe === kNoKeyframe ? -1 : keyframe,
  };
}

/** Those within a radius, or all where there are none. */
function nearest<T extends { off: number }>(all: T[], radius: number): T[] {
  const some = all.filter((it) => it.off <= radius);
  return (some.length > 0 ? some : all).slice(0, 50_000);
}
