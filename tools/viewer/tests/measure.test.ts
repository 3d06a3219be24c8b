// SPDX-License-Identifier: BSD-2-Clause
import assert from "node:assert/strict";
import { test } from "node:test";
import type { Vec3 } from "../src/geometry";
import { covarianceOf, depthError95, errorOf, measureText, relativeError, spreadOf, valueOf } from "../src/measure";

const up: Vec3 = [0, 0, 1];
const square: Vec3[] = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]];

test("distances, heights, angles and areas", () => {
  assert.equal(valueOf("distance", [[0, 0, 0], [3, 0, 4]], up), 5);
  assert.equal(valueOf("height", [[0, 0, 0], [3, 0, -4]], up), 4);
  assert.equal(valueOf("angle", [[1, 0, 0], [0, 0, 0], [0, 2, 0]], up), 90);
  assert.equal(valueOf("area", square, up), 4);
  assert.equal(valueOf("area", square.slice(0, 3), up), 2);
});

test("confidence means what pmsp::DepthMap says", () => {
  assert.ok(Math.abs(relativeError(0.5) - 0.005) < 1e-12);
  assert.ok(Math.abs(relativeError(0.1) - 0.045) < 1e-12);
});

test("the less confidence, the heavier the tails", () => {
  const beyondNormal = (c: number): number => depthError95(c) / (2.906 * relativeError(c));
  assert.ok(beyondNormal(0.9) > 1 && beyondNormal(0.9) < 1.1);
  assert.ok(beyondNormal(0.1) > 3);
  assert.ok(depthError95(1) > 0);
});

test("an error along the ray counts where one measures along it", () => {
  const point = (position: Vec3) => ({ position, confidence: 0.5, keyframe: 0, spread: 0.01 });
  const camera: Vec3 = [0, 0, 0];
  const error = (a: Vec3, b: Vec3): number =>
    errorOf("distance", [a, b], [a, b].map((p) => covarianceOf(point(p), camera, 1)), up);
  const along = error([10, 0, 0], [12, 0, 0]);
  const across = error([10, 0, 0], [10, 0.5, 0]);
  assert.ok(Math.abs(along - depthError95(0.5) * Math.hypot(10, 12)) < 0.01 * along, `${along}`);
  assert.ok(across < 0.1 * along);
  assert.ok(across > 0.01 * Math.SQRT2 * 0.999, "what lies around counts in each direction");
});

test("a point whose camera nobody knows is as uncertain in each direction", () => {
  const point = { position: [5, 0, 0] as Vec3, confidence: 0.5, keyframe: -1, spread: 0 };
  const error = (other: Vec3): number =>
    errorOf("distance", [point.position, other], [covarianceOf(point, null, 4), new Array<number>(9).fill(0)], up);
  assert.ok(Math.abs(error([0, 0, 0]) - 4 * depthError95(0.5)) < 1e-6);
  assert.ok(Math.abs(error([5, 3, 0]) - 4 * depthError95(0.5)) < 1e-6);
});

/** Points of surfaces z = height(x, y) around the origin, one on each pixel of side 1. */
function surface(height: (x: number, y: number) => number, radius = 6): Vec3[] {
  const points: Vec3[] = [];
  for (let x = -radius; x <= radius; ++x) {
    for (let y = -radius; y <= radius; ++y) {
      const at: Vec3 = [x, y, height(x, y)];
      if (Math.hypot(...at) <= radius) points.push(at);
    }
  }
  return points;
}

test("walls are known best, edges and corners worse", () => {
  const spread = (near: Vec3[]): number => spreadOf({ near, radius: 6, off: 0, gap: 0 });
  const wall = spread(surface(() => 0));
  const slanted = spread(surface((x, y) => 0.3 * x - 0.2 * y));
  const edge = spread(surface((x) => Math.abs(x)));
  const corner = spread(surface((x, y) => 1.4 * Math.max(x, -0.5 * x + 0.87 * y, -0.5 * x - 0.87 * y)));
  assert.ok(wall > 0.3 && wall < 1, `${wall}`); // less than a pixel
  assert.ok(Math.abs(slanted - wall) < 0.1);
  assert.ok(edge > 4 * wall, `${edge}`);
  assert.ok(corner > 4 * wall, `${corner}`);
});

test("few points, a click beside the point and a step in depth let it be farther off", () => {
  const near = surface(() => 0);
  const spread = (more: object): number => spreadOf({ near, radius: 6, off: 0, gap: 0, ...more });
  const best = spread({});
  assert.ok(spread({ near: near.filter((_, i) => i % 9 === 0) }) > 2.5 * best);
  assert.ok(spread({ near: near.slice(0, 1) }) > 6);
  assert.ok(spread({ off: 3 }) > 3);
  assert.ok(spread({ gap: 50 }) > 50);
});

test("what is level, upright, straight or without extent is as uncertain as what nearly is", () => {
  // 1, 2 and 3 squared along the axes.
  const one = [1e-4, 0, 0, 0, 4e-4, 0, 0, 0, 9e-4];
  const error = (kind: Parameters<typeof errorOf>[0], ...points: Vec3[]): number => errorOf(kind, points, points.map(() => one), up);
  const close = (a: number, b: number): void => assert.ok(Math.abs(a - b) < 1e-3 * b, `${a} is not ${b}`);
  for (const dz of [0, 1e-6, -1e-6, 1e-3, 0.5]) close(error("height", [0, 0, 1], [2, 0, 1 + dz]), 0.03 * Math.SQRT2);
  close(error("horizontal", [0, 0, 0], [0, 0, 2]), 0.02 * Math.SQRT2);
  close(error("horizontal", [0, 0, 0], [0, 0.01, 2]), 0.02 * Math.SQRT2);
  close(error("distance", [1, 2, 3], [1, 2, 3]), 0.03 * Math.SQRT2);
  // The middle of a straight line counts twice: 0.03 * sqrt(1 + 4 + 1) across 1 m.
  const straight = (0.03 * Math.sqrt(6) * 180) / Math.PI;
  for (const dz of [0, 1e-6, 1e-3]) close(error("angle", [-1, 0, 0], [0, 0, dz], [1, 0, 0]), straight);
  close(error("angle", [1, 0, 0], [0, 0, 0], [1, 0, 0]), (0.03 * Math.SQRT2 * 180) / Math.PI);
  close(error("angle", [0, 0, 1], [0, 0, 0], [1, 0, 0]), (Math.sqrt(1e-4 + 9e-4 + 1e-4 + 9e-4) * 180) / Math.PI);
  assert.ok(error("area", [0, 0, 0], [1, 0, 0], [2, 0, 0]) > 0.01);
});

test("the error of an area grows with its sides", () => {
  const covariances = square.map(() => [1e-4, 0, 0, 0, 1e-4, 0, 0, 0, 1e-4]);
  const small = errorOf("area", square, covariances, up);
  const large = errorOf("area", square.map(([x, y, z]): Vec3 => [3 * x, 3 * y, z]), covariances, up);
  assert.ok(Math.abs(large / small - 3) < 1e-3);
});

test("numbers have the digits that the error leaves", () => {
  assert.equal(measureText("distance", 1.23456, 0.0123, "m"), "1.235 ± 0.012 m");
  assert.equal(measureText("area", 12.3, 2.4, "map units"), "12.3 ± 2.4 map units²");
  assert.equal(measureText("angle", 89.9, 25, "m"), "90 ± 25°");
});
