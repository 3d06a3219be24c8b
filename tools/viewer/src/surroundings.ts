// SPDX-License-Identifier: BSD-2-Clause
// What lies around a point that was picked, which says how far off it may be (measure.ts).
import { type Camera, Vector3 } from "three";
import type { Cloud } from "./cloud";
import { type Vec3, add, dot, norm, sub, thinnest, times, unit } from "./geometry";
import { type Found, type Surroundings, type Taken, kBesidePixels, kFewPoints, kRadiusPixels, kStepPixels, spreadOf } from "./measure";
import { isPerspective } from "./sight";

export interface Eyes {
  /** Angle of a pixel of the depth maps [rad]. */
  pixel: number;
  /** How far away points are where nobody knows their camera. */
  reach: number;
  /** Where that of a keyframe stood; null = nobody knows. */
  camera: (keyframe: number) => Vec3 | null;
}

/** A point with that many times the first radius around it has nothing that lies near. */
const kMaxGrowth = 8;

/** Fewer points than that in front are strays. */
const kStray = 3;

/** Side of a pixel of the depth map at a point. */
export function pixelAt(point: Pick<Found, "position" | "keyframe">, eyes: Eyes): number {
  const camera = eyes.camera(point.keyframe);
  return eyes.pixel * (camera ? norm(sub(point.position, camera)) : eyes.reach);
}

/** A point that was found at a place of the picture (-1 to 1), with how far off it may be. */
export function pickedFrom(cloud: Cloud, camera: Camera, found: Found, x: number, y: number, eyes: Eyes): Taken {
  const around = surroundingsOf(cloud, camera, found.position, x, y, pixelAt(found, eyes));
  return { ...found, spread: spreadOf(around), front: around.gap, rim: 0 };
}

/** From the eye through a place of the picture. */
export function rayThrough(camera: Camera, x: number, y: number): { from: Vec3; along: Vec3 } {
  const at = (depth: number): Vec3 => new Vector3(x, y, depth).unproject(camera).toArray() as [number, number, number];
  const from = isPerspective(camera) ? (camera.position.toArray() as [number, number, number]) : at(-1);
  return { from, along: unit(sub(at(0.5), from)) };
}

/** `x` and `y`: where the click was, -1 to 1. `pixel`: side of a pixel of the depth map there. */
export function surroundingsOf(cloud: Cloud, camera: Camera, place: Vec3, x: number, y: number, pixel: number): Surroundings {
  const { from, along } = rayThrough(camera, x, y);
  const ahead = dot(sub(place, from), along);
  let radius = kRadiusPixels * pixel;
  let near = pointsWithin(cloud, place, radius);
  for (let times = 1; near.length < kFewPoints && times < kMaxGrowth; times *= 2) {
    radius *= 2;
    near = pointsWithin(cloud, place, radius);
  }
  const plane = near.length >= kFewPoints ? thinnest(near) : null;
  const isOnPlane = (at: Vec3): boolean => plane !== null && Math.abs(dot(sub(at, place), plane.normal)) < (kStepPixels / 2) * pixel;
  const gaps: number[] = [];
  const beside = kBesidePixels * pixel;
  const step = kStepPixels * pixel;
  const isFlat = !isPerspective(camera);
  const [fx, fy, fz] = from;
  const [ax, ay, az] = along;
  for (const cube of cloud.cubes) {
    if (asideOf(cube.center.toArray(), from, along, ahead) > cube.radius + beside) continue;
    cloud.visit(cube, (px, py, pz, i) => {
      const dx = px - fx;
      const dy = py - fy;
      const dz = pz - fz;
      const depth = dx * ax + dy * ay + dz * az;
      const gap = ahead - depth;
      if (gap < 0 || depth <= 0) return;
      const most = isFlat ? beside : (beside * depth) / ahead;
      if (dx * dx + dy * dy + dz * dz - depth * depth > most * most) return;
      const at: Vec3 = [px, py, pz];
      // A floor that is seen at a flat angle comes nearer, too, and is no step.
      if ((gap < step || !isOnPlane(at)) && cloud.isShown(camera, cube, i, at)) gaps.push(gap);
    });
  }
  const off = norm(sub(place, add(from, times(along, ahead))));
  return { near, radius, off, gap: stepIn(gaps, step) };
}

/** The first of the places along a ray, from 0, that comes after nothing for a while; 0 = none, or only points that stray. */
export function stepIn(gaps: number[], step: number): number {
  gaps.sort((a, b) => a - b);
  for (let i = 0; i + kStray <= gaps.length; ++i) {
    const gap = gaps[i] ?? 0;
    if (gap - (gaps[i - 1] ?? 0) > step) return gap;
  }
  return 0;
}

/** Of a place from the stretch of a ray that ends at `ahead`. */
function asideOf(place: readonly number[], from: Vec3, along: Vec3, ahead: number): number {
  const at: Vec3 = [place[0] ?? 0, place[1] ?? 0, place[2] ?? 0];
  const depth = Math.max(0, Math.min(ahead, dot(sub(at, from), along)));
  return norm(sub(at, add(from, times(along, depth))));
}

export function pointsWithin(cloud: Cloud, place: Vec3, radius: number): Vec3[] {
  const found: Vec3[] = [];
  const [x, y, z] = place;
  for (const cube of cloud.cubes) {
    if (cube.center.distanceTo(new Vector3(x, y, z)) > cube.radius + radius) continue;
    cloud.visit(cube, (px, py, pz) => {
      if ((px - x) ** 2 + (py - y) ** 2 + (pz - z) ** 2 <= radius * radius) found.push([px, py, pz]);
    });
  }
  return found;
}
