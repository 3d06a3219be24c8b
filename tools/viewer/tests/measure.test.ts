// SPDX-License-Identifier: BSD-2-Clause
import assert from "node:assert/strict";
import { test } from "node:test";
import type { Vec3 } from "../src/geometry";
import { covarianceOf, errorOf, measureText, relativeError, valueOf } from "../src/measure";

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

test("an error along the ray counts where one measures along it", () => {
  const point = (position: Vec3) => ({ position, confidence: 0.1, keyframe: 0 });
  const camera: Vec3 = [0, 0, 0];
  const error = (a: Vec3, b: Vec3): number =>
    errorOf("distance", [a, b], [a, b].map((p) => covarianceOf(point(p), camera, 0.001, 1)), up);
  const along = error([10, 0, 0], [12, 0, 0]);
  const across = error([10, 0, 0], [10, 0.5, 0]);
  assert.ok(Math.abs(along - 2.906 * 0.045 * Math.hypot(10, 12)) < 0.01 * along, `${along}`);
  assert.ok(across < 0.1 * along);
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
