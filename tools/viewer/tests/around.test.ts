// SPDX-License-Identifier: BSD-2-Clause
import assert from "node:assert/strict";
import { test } from "node:test";
import { coveredAround, openText } from "../src/around";
import type { Pose, Vec3 } from "../src/geometry";

const cloud = (points: Vec3[]) => ({
  loaded: points.length,
  forEach: (stride: number, visit: (x: number, y: number, z: number) => void) => {
    for (let i = 0; i < points.length; i += stride) visit(...points[i]!);
  },
});

/** Directions all around, from the middle of a ball. */
const ball: Vec3[] = Array.from({ length: 40_000 }, (_, i) => {
  const z = 1 - (2 * i + 1) / 40_000;
  const angle = i * 2.399963;
  const r = Math.sqrt(1 - z * z);
  return [r * Math.cos(angle), z, r * Math.sin(angle)];
});
const here: Pose = { center: [0, 0, 0], rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1] };

test("points all around leave nothing open, and none leave all", () => {
  assert.equal(coveredAround(cloud(ball), here).open, 0);
  const none = coveredAround(cloud([]), here);
  assert.equal(none.open, 1);
  assert.equal(none.openSides.length, 6);
  assert.equal(openText(none), "100 % of the directions from the camera have no points yet.");
});

test("half a ball leaves the other half open, on the side where it is", () => {
  const front = coveredAround(cloud(ball.filter((p) => p[2] > 0)), here);
  assert.ok(Math.abs(front.open - 0.5) < 0.02, `${front.open}`);
  assert.deepEqual(front.openSides, ["behind"]);
  assert.match(openText(front), /^(49|50|51) % .* yet, mostly behind\.$/);
  const lower = coveredAround(cloud(ball.filter((p) => p[1] > 0)), here); // +y is down
  assert.deepEqual(lower.openSides, ["above"]);
  assert.equal(lower.seen[0], 0);
  assert.equal(lower.seen[lower.seen.length - 1], 1);
});

test("directions are those of the camera, from where it is", () => {
  const moved = ball.filter((p) => p[2] > 0).map((p): Vec3 => [p[0] + 5, p[1] + 6, p[2] + 7]);
  // Turned so that it looks along -z of the page: what it sees ahead is the empty half.
  const turned: Pose = { center: [5, 6, 7], rotation: [-1, 0, 0, 0, 1, 0, 0, 0, -1] };
  assert.deepEqual(coveredAround(cloud(moved), turned).openSides, ["ahead"]);
});
