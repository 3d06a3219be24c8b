// SPDX-License-Identifier: BSD-2-Clause
import assert from "node:assert/strict";
import { test } from "node:test";
import { type Vec3, norm, sub, unit } from "../src/geometry";
import { kSnapPixels, planesOf, snapped } from "../src/snap";

let state = 7;
const noise = (size: number): number => size * (((state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32) * 2 - 1);

/** Points of a corner of a room, one on each pixel of side 1, rounded off within `round`; in the quadrant of positive numbers. */
function corner(walls: readonly (0 | 1 | 2)[], round = 0, rough = 0.1): Vec3[] {
  const points: Vec3[] = [];
  for (const wall of walls) {
    for (let a = 0; a < kSnapPixels; ++a) {
      for (let b = 0; b < kSnapPixels; ++b) {
        const at = [a + 0.5, b + 0.5];
        at.splice(wall, 0, noise(rough) + 0.3 * Math.max(0, round - Math.min(...at)));
        points.push(at as unknown as Vec3);
      }
    }
  }
  return points;
}
const along = unit([-1, -1, -1]);

test("a corner is where three planes meet, though it is rounded off", () => {
  const points = corner([0, 1, 2], 3);
  assert.equal(planesOf(points, 1).length, 3);
  const found = snapped(points, [1, 1.2, 0.8], along, 1);
  assert.equal(found?.kind, "corner");
  assert.ok(norm(found!.position) < 0.3, `${found!.position}`);
  assert.ok(found!.spread >= norm(found!.position) && found!.spread < 2.5, `${found!.spread}`);
});

test("an edge is the nearest place of the line where two planes meet", () => {
  const found = snapped(corner([0, 1]), [1, 0.5, 8], along, 1);
  assert.equal(found?.kind, "edge");
  assert.ok(norm(sub(found!.position, [0, 0, 8])) < 0.3, `${found!.position}`);
});

test("away from edges a point moves along the click to its plane", () => {
  const found = snapped(corner([0, 1, 2]), [0.6, 8, 9], unit([-1, -0.5, 0]), 1);
  assert.equal(found?.kind, "plane");
  assert.ok(norm(sub(found!.position, [0, 7.7, 9])) < 0.15, `${found!.position}`);
});

test("points of no plane snap nowhere, few points neither", () => {
  const cloud = Array.from({ length: 500 }, (): Vec3 => [noise(16), noise(16), noise(16)]);
  assert.equal(snapped(cloud, [0, 0, 0], along, 1), null);
  assert.equal(snapped(corner([0]).slice(0, 20), [0, 1, 1], along, 1), null);
  assert.equal(snapped([], [0, 0, 0], along, 1), null);
});

test("rough points let a snapped one be farther off", () => {
  const spread = (rough: number): number => snapped(corner([0, 1, 2], 0, rough), [0.5, 0.5, 0.5], along, 1)!.spread;
  assert.ok(spread(0.9) > 1.05 * spread(0.05));
});

test("the same points snap to the same place", () => {
  const points = corner([0, 1, 2], 2, 0.4);
  assert.deepEqual(snapped(points, [1, 1, 1], along, 1), snapped(points, [1, 1, 1], along, 1));
});
