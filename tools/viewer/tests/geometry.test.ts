// SPDX-License-Identifier: BSD-2-Clause
import assert from "node:assert/strict";
import { test } from "node:test";
import {
  type Pose,
  type Vec3,
  basisAround,
  cross,
  dot,
  fromCamera,
  mainDirection,
  norm,
  normalFrom,
  panoramaPlace,
  roundLength,
  sub,
  thinnest,
  toCamera,
} from "../src/geometry";

const close = (a: number, b: number, by = 1e-9): void => assert.ok(Math.abs(a - b) <= by, `${a} is not ${b}`);

test("a panorama shows ahead in its middle, right on its right, up at its top", () => {
  assert.deepEqual(panoramaPlace([0, 0, 1]), [0.5, 0.5]);
  close(panoramaPlace([1, 0, 0])[0], 0.75);
  close(panoramaPlace([-1, 0, 0])[0], 0.25);
  close(panoramaPlace([0, -1, 0])[1], 0);
  close(panoramaPlace([0, 1, 0])[1], 1);
});

test("directions go into the camera and back", () => {
  const turned: Pose = { center: [1, 2, 3], rotation: [0, 0, -1, 0, 1, 0, 1, 0, 0] };
  assert.deepEqual(toCamera(turned, [1, 0, 0]), [0, 0, 1]);
  const back = fromCamera(turned, toCamera(turned, [0.3, -0.4, 0.5]));
  assert.ok(norm(sub(back, [0.3, -0.4, 0.5])) < 1e-12);
});

test("a basis is right-handed and keeps up", () => {
  for (const up of [[0, -1, 0], [0, 0, 1], [1, 2, -3]] as Vec3[]) {
    const [a, b, c] = basisAround(up, [1, 0, 0]);
    close(norm(sub(cross(a, b), c)), 0);
    close(dot(c, up), norm(up));
  }
});

test("the main direction is that of the longer side", () => {
  const path: Vec3[] = [[0, 0, 0], [3, 5, 3.1], [6, -5, 5.9]];
  const found = mainDirection(path, [0, -1, 0]);
  close(Math.abs(found[0] * Math.SQRT1_2 + found[2] * Math.SQRT1_2), 1, 1e-2);
});

test("normals survive two bytes", () => {
  assert.deepEqual(normalFrom(0, 0), [0, 0, 1]);
  assert.ok(norm(sub(normalFrom(127, 0), [1, 0, 0])) < 1e-9);
  assert.ok(norm(sub(normalFrom(127, 127), [0, 0, -1])) < 1e-9);
});

test("lengths of scale bars are 1, 2 or 5 times a power of ten", () => {
  assert.deepEqual([0.0034, 1, 1.99, 2, 49, 700].map(roundLength), [0.002, 1, 1, 2, 20, 500]);
});

test("a slab's normal and thickness come from its points", () => {
  const normal: Vec3 = [2 / 3, -1 / 3, 2 / 3];
  const [a, b] = basisAround(normal, [1, 0, 0]);
  const points: Vec3[] = [];
  for (let i = -5; i <= 5; ++i) {
    for (let k = -5; k <= 5; ++k) {
      const off = (i + k) % 2 === 0 ? 0.1 : -0.1;
      points.push([0, 1, 2].map((n) => 7 + i * a[n]! + k * b[n]! + off * normal[n]!) as unknown as Vec3);
    }
  }
  const slab = thinnest(points);
  close(Math.abs(dot(slab.normal, normal)), 1, 1e-6);
  close(slab.thickness, 0.1, 1e-3);
  close(norm(sub(slab.center, [7, 7, 7])), 0, 0.01);
});

test("a slab of too few points, or of points in one place, has no thickness", () => {
  for (const points of [[], [[1, 2, 3]], [[1, 2, 3], [1, 2, 3]], [[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [1, 0, 0], [0, 1, 0]]] as Vec3[][]) {
    const slab = thinnest(points);
    close(slab.thickness, 0, 1e-6);
    close(norm(slab.normal), 1);
  }
});
