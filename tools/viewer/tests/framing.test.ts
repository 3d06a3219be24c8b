// SPDX-License-Identifier: BSD-2-Clause
import assert from "node:assert/strict";
import { test } from "node:test";
import { busyBox, busyStretch, planHalf, seenOf, wallDirection } from "../src/framing";
import type { Vec3 } from "../src/geometry";

const even = (low: number, high: number, count: number): number[] =>
  Array.from({ length: count }, (_, i) => low + ((high - low) * i) / (count - 1));

test("all that lies evenly is shown", () => {
  const [low, high] = busyStretch(even(-3, 5, 1001));
  assert.ok(Math.abs(low + 2.92) < 0.02 && Math.abs(high - 4.92) < 0.02, `${low} ${high}`);
});

test("a crowd far away does not make the room small", () => {
  for (const far of [20, 250, 500]) {
    const [low, high] = busyStretch([...even(-3, 5, 1000), ...even(180, 220, far)]);
    assert.ok(low >= -3 && low < -2.5 && high <= 5 && high > 4.5, `${far}: ${low} ${high}`);
  }
});

test("what is as large as the rest stays", () => {
  const [low, high] = busyStretch([...even(0, 10, 800), ...even(10, 14, 200)]);
  assert.ok(low < 0.5 && high > 13.5, `${low} ${high}`);
});

test("values that are the same, and few of them, have a stretch", () => {
  assert.deepEqual(busyStretch([2, 2, 2, 2]), [2, 2]);
  assert.deepEqual(busyStretch([7]), [7, 7]);
  assert.equal(busyBox([], []), null);
});

test("the box holds the room and the path, not the street outside", () => {
  const room: Vec3[] = even(0, 1, 2000).map((t, i) => [4 * t, (i * 7) % 3, (i * 13) % 2]);
  const street: Vec3[] = even(0, 1, 300).map((t) => [150 + 40 * t, -80 + 160 * t, -10]);
  const box = busyBox([...room, ...street], [[-1, 1, 1]]);
  assert.ok(box);
  assert.equal(box.low[0], -1);
  assert.ok(box.high[0] > 3.8 && box.high[0] <= 4);
  assert.ok(box.low[2] >= 0 && box.high[1] <= 2);
});

test("a plan shows all of the box, whichever side is longer", () => {
  for (const [high, aspect] of [[[8, 4, 3], 2], [[4, 8, 3], 2], [[8, 4, 3], 0.5]] as [Vec3, number][]) {
    const half = planHalf([0, 0, 0], high, aspect);
    const [wide, tall] = [high[0] / (2 * half * aspect), high[1] / (2 * half)];
    assert.ok(Math.max(wide, tall) < 1 && Math.max(wide, tall) > 0.84, `${wide} ${tall}`);
  }
});

test("a building is straightened to its walls, whatever else stands around", () => {
  const up: Vec3 = [0, 0, 1];
  const turned = (angle: number): Vec3 => [Math.cos(angle), Math.sin(angle), 0];
  const walls = even(0, 399, 400).map((i) => turned(0.4 + (Math.PI / 2) * (i % 4) + 0.02 * Math.sin(i)));
  const clutter = even(0, 299, 300).map((i) => turned(2.4 * i));
  const found = wallDirection([...walls, ...clutter, ...clutter.map((): Vec3 => [0, 0, 1])], up);
  assert.ok(found);
  const off = (Math.atan2(found[1], found[0]) - 0.4) / (Math.PI / 2);
  assert.ok(Math.abs(off - Math.round(off)) < 0.01, `${off}`);
  assert.equal(wallDirection(clutter, up), null);
  assert.equal(wallDirection([], up), null);
});

test("what is seen is measured without strays", () => {
  const places = even(-0.5, 0.3, 1000).map((x): [number, number] => [x, x / 2]);
  const { middle, half } = seenOf([...places, [7, 9], [-8, 3]]);
  assert.ok(Math.abs(middle[0] + 0.1) < 0.01 && Math.abs(middle[1] + 0.05) < 0.01, `${middle}`);
  assert.ok(Math.abs(half - 0.4) < 0.01, `${half}`);
});
