// SPDX-License-Identifier: BSD-2-Clause
import assert from "node:assert/strict";
import { test } from "node:test";
import { Matrix4 } from "three";
import type { Cloud } from "../src/cloud";
import type { Vec3 } from "../src/geometry";
import { markSight, planGrid, Seen, unseenRuns } from "../src/seen";

test("cells between an eye and a point are seen, up to the end of the plan", () => {
  const grid = planGrid([0, 0, 0], [96, 48, 10]);
  assert.deepEqual([grid.columns, grid.rows, grid.cell], [96, 48, 1]);
  markSight(grid, [10.5, 5.5], [20.5, 5.5]);
  markSight(grid, [90.5, 40.5], [1e9, 40.5]);
  const seen = [...grid.seen].reduce((sum, it) => sum + it, 0);
  assert.equal(seen, 11 + 6);
  assert.ok([10, 15, 20].every((x) => grid.seen[5 * 96 + x] === 1));
  const runs = unseenRuns(grid);
  assert.deepEqual(runs.filter(([row]) => row === 5), [[5, 0, 10], [5, 21, 75]]);
  assert.deepEqual(runs.filter(([row]) => row === 40), [[40, 0, 90]]);
  assert.deepEqual(runs.filter(([row]) => row === 6), [[6, 0, 96]]);
});

test("a plan without extent has a cell", () => {
  assert.equal(planGrid([1, 1, 1], [1, 1, 1]).seen.length, 1);
});

test("landmarks remain where there are no dense points", async () => {
  const axes: [Vec3, Vec3, Vec3] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  const dense: Vec3[] = [];
  const cloud = {
    basis: axes,
    low: [0, 0, 0],
    high: [80, 60, 0],
    get loaded(): number {
      return dense.length;
    },
    keyframeCubes: new Map([["7", { matrix: new Matrix4() }]]),
    visit: (_: unknown, visit: (...p: Vec3) => void) => dense.forEach((p) => visit(...p)),
  };
  const landmarks: Vec3[] = [[20.5, 30.5, 0.5], [60.5, 30.5, 0.5]];
  const drawn = await new Promise<Seen>((done) => {
    const seen: Seen = new Seen(cloud as unknown as Cloud, () => [["7", [40, 30, 0]]], () => landmarks, () => done(seen));
    seen.changed();
    assert.equal(seen.landmarks.length, 2, "at once while there are no points");
    dense.push([20.7, 30.6, 0.6]);
  });
  assert.deepEqual(drawn.landmarks, [landmarks[1]]);
  assert.equal(drawn.grid?.seen.filter((it) => it === 1).length, 25);
});
