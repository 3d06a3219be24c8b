// SPDX-License-Identifier: BSD-2-Clause
import assert from "node:assert/strict";
import { test } from "node:test";
import { bytesFromBase64, nodePoints } from "../src/data";

test("points are read as src/export/page_cloud.h lays them out", () => {
  const bytes = Uint8Array.from([
    ...[1, 0, 2, 0, 255, 255], ...[0, 1, 0, 0, 0, 128],
    ...[10, 20, 30], ...[40, 50, 60],
    ...[255, 128],
    ...[3, 9],
    ...[1, 255], ...[129, 0],
    ...[7, 0], ...[255, 255],
  ]);
  const points = nodePoints(bytes, 2);
  assert.deepEqual([...points.positions], [1, 2, 65535, 0, 256, 0, 32768, 0]);
  assert.deepEqual([...points.colors], [10, 20, 30, 255, 40, 50, 60, 128]);
  assert.deepEqual([...points.normalsAndViews], [1, 255, 3, 0, 129, 0, 9, 0]);
  assert.deepEqual([...points.keyframes], [7, 65535]);
});

test("a block that is cut off is refused", () => {
  assert.throws(() => nodePoints(new Uint8Array(29), 2), /29 bytes; expected 30/);
  assert.deepEqual([...bytesFromBase64(" AQI= \n")], [1, 2]);
});
