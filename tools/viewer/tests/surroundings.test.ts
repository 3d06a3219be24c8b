// SPDX-License-Identifier: BSD-2-Clause
import assert from "node:assert/strict";
import { test } from "node:test";
import { PerspectiveCamera, Vector3 } from "three";
import { noCut } from "../src/cuts";
import { Cloud } from "../src/cloud";
import type { Vec3 } from "../src/geometry";
import { spreadOf } from "../src/measure";
import { pixelAt, stepIn, surroundingsOf } from "../src/surroundings";

const pixel = 0.01;

/** Points in a cube of side 20 around the origin. */
function cloudOf(points: readonly Vec3[]): Cloud {
  const cloud = new Cloud([{ level: 0, corner: [-10, -10, -10], side: 20, points: points.length }], [[1, 0, 0], [0, 1, 0], [0, 0, 1]]);
  const positions = new Uint16Array(4 * points.length);
  points.forEach((p, i) => p.forEach((x, k) => (positions[4 * i + k] = Math.round(((x + 10) / 20) * 65535))));
  const bytes = (): Uint8Array<ArrayBuffer> => new Uint8Array(4 * points.length);
  const keyframes = new Uint16Array(points.length);
  cloud.fill(0, { count: points.length, positions, colors: bytes(), normalsAndViews: bytes(), keyframes });
  cloud.setLook("photo", 1, noCut(), false);
  return cloud;
}

/** From the origin along x. */
function view(to: Vec3): PerspectiveCamera {
  const camera = new PerspectiveCamera(60, 1, 0.001, 100);
  camera.up.set(0, 0, 1);
  camera.lookAt(new Vector3(...to));
  camera.updateMatrixWorld();
  return camera;
}

/** A wall across x, a point each pixel as seen from the origin. */
function wall(x: number, from: number, to: number): Vec3[] {
  const points: Vec3[] = [];
  for (let y = from; y < to; y += x * pixel) for (let z = -0.5; z < 0.5; z += x * pixel) points.push([x, y, z]);
  return points;
}
const around = (points: readonly Vec3[], place: Vec3, aim: Vec3 = place) =>
  surroundingsOf(cloudOf(points), view(aim), place, 0, 0, pixel * place[0]);

test("a pixel is as large as its distance makes it", () => {
  const eyes = { pixel, reach: 7, camera: (i: number): Vec3 | null => (i === 0 ? [1, 0, 0] : null) };
  assert.ok(Math.abs(pixelAt({ position: [5, 0, 0], keyframe: 0 }, eyes) - 0.04) < 1e-12);
  assert.ok(Math.abs(pixelAt({ position: [5, 0, 0], keyframe: -1 }, eyes) - 0.07) < 1e-12);
});

test("in the middle of a wall a point is known to less than a pixel", () => {
  const found = around(wall(4, -1, 1), [4, 0, 0]);
  assert.ok(found.near.length > 90 && found.near.length < 130, `${found.near.length}`);
  assert.equal(found.gap, 0);
  assert.ok(spreadOf(found) < 0.04, `${spreadOf(found)}`);
});

test("what ends in front of the wall beside the click may have been meant", () => {
  const points = [...wall(4, -1, 1), ...wall(2, 0.04, 0.4)]; // two pixels beside
  const found = around(points, [4, 0, 0]);
  assert.ok(Math.abs(found.gap - 2) < 0.01, `${found.gap}`);
  assert.equal(around(points, [4, -0.5, 0]).gap, 0, "far beside");
  assert.equal(around(points, [2, 0.1, 0]).gap, 0, "what lies in front was taken");
  assert.equal(around([...wall(4, -1, 1), [2, 0.01, 0], [2, 0, 0.01]], [4, 0, 0]).gap, 0, "two points stray");
});

test("a floor that comes nearer is no step, and neither is a wall that meets another", () => {
  const floor: Vec3[] = [];
  for (let x = 1; x < 9; x += 0.05) for (let y = -0.5; y < 0.5; y += 0.05) floor.push([x, y, -0.7]);
  assert.equal(around(floor, [6, 0, -0.7]).gap, 0);
  const withHole = floor.filter(([x]) => x < 4.8 || x > 5.5);
  assert.equal(around(withHole, [6, 0, -0.7]).gap, 0);
  assert.ok(around(withHole.map(([x, y, z]): Vec3 => [x, y, x < 5 ? z + 0.4 : z]), [6, 0, -0.7]).gap > 1, "a stage in front of it");
  const side: Vec3[] = [];
  for (let x = 1; x < 4; x += 0.04) for (let z = -0.5; z < 0.5; z += 0.04) side.push([x, 0.08 + 0.3 * (4 - x), z]);
  assert.equal(around([...wall(4, -1, 0.1), ...side], [4, 0, 0]).gap, 0);
});

test("where points are few it looks farther", () => {
  const few = wall(4, -3, 3).filter((_, i) => i % 50 === 0);
  const found = around(few, few[Math.floor(few.length / 2)]!);
  assert.ok(found.radius > 6 * 0.04 && found.near.length >= 1);
  assert.ok(spreadOf(found) > 0.1);
  assert.ok(around(wall(4, -1, 1), [4, 0, 0], [4, 0.2, 0]).off > 0.15);
});

test("a step is what comes after nothing", () => {
  assert.equal(stepIn([], 1), 0);
  assert.equal(stepIn([0, 0.5, 1, 1.5, 2.2], 1), 0);
  assert.equal(stepIn([9, 0, 0.5, 7, 8], 1), 7);
  assert.equal(stepIn([0, 0.5, 7, 8], 1), 0);
});
