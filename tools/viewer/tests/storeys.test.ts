// SPDX-License-Identifier: BSD-2-Clause
import assert from "node:assert/strict";
import { test } from "node:test";
import { cutFromShares, isSameCut, noCut, planCut, sliceCut, storeyCut } from "../src/cuts";
import { paperSize } from "../src/print";
import { storeysOf } from "../src/storeys";

const many = (count: number, height: number, thickness = 0.02): number[] =>
  Array.from({ length: count }, (_, i) => height + thickness * Math.sin(7 * i));

test("two floors that were flown over are two storeys; tables, a cellar and the roof are none", () => {
  const floors = [...many(5000, 0), ...many(4000, 3), ...many(900, 0.75), ...many(2500, 6.1), ...many(2000, -2.8)];
  const cameras = [...many(30, 1.5, 0.1), ...many(20, 4.4, 0.1)];
  const found = storeysOf(floors, cameras, -3, 6.5);
  assert.equal(found.length, 2);
  const [lower, upper] = found;
  assert.ok(Math.abs(lower!.floor) < 0.05 && Math.abs(upper!.floor - 3) < 0.05, `${lower!.floor} ${upper!.floor}`);
  assert.ok(Math.abs(lower!.camera - 1.5) < 0.1 && Math.abs(upper!.camera - 4.4) < 0.1);
  assert.equal(lower!.top, upper!.floor);
  assert.equal(upper!.top, null);
});

test("a hall with large shelves is one storey", () => {
  const floors = [...many(5000, 0), ...many(2500, 1)];
  const found = storeysOf(floors, [...many(20, 0.9, 0.05), ...many(20, 1.6, 0.1)], 0, 8);
  assert.equal(found.length, 1);
  assert.ok(Math.abs(found[0]!.floor) < 0.05);
});

test("without floors, cameras or height there is one storey", () => {
  for (const found of [storeysOf([], [1, 2], 0, 3), storeysOf([0, 0], [], 0, 3), storeysOf([0], [0], 0, 0)]) assert.equal(found.length, 1);
});

test("cuts: a plan ends above the cameras, a storey below the next floor, old shares are lengths", () => {
  const storey = { floor: 3, top: 6, camera: 4.5, highestCamera: 4.7 };
  const plan = planCut(storey, false);
  assert.ok(plan[4]! < 3 && plan[4]! > 2.5 && plan[5]! > 4.7 && plan[5]! < 5.5, `${plan}`);
  assert.equal(planCut(storey, true)[4], null);
  assert.ok(storeyCut(storey, false)[5]! < 6 && storeyCut(storey, false)[5]! > 5.5);
  assert.deepEqual(sliceCut(1.5, 0.2).slice(4), [1.4, 1.6]);
  assert.deepEqual(cutFromShares([0.25, 1, 0, 1, 0, 0.5], [-2, 0, 1], [2, 1, 3]), [-1, null, null, null, null, 2]);
  assert.ok(isSameCut(noCut(), noCut()) && !isSameCut(noCut(), plan) && isSameCut(plan, planCut(storey, false)));
});

test("plans print at 1 : 100, or at the next scale with which they fit onto a page", () => {
  assert.deepEqual(paperSize(10, 6), { scale: 100, width: 100, height: 60 });
  assert.equal(paperSize(30, 6).scale, 200);
  assert.equal(paperSize(6, 100).scale, 500);
  assert.deepEqual([185, 2000, 4000, 12_345].map((wide) => paperSize(wide, 1).scale), [1000, 20_000, 50_000, 100_000]);
});
