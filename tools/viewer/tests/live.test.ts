// SPDX-License-Identifier: BSD-2-Clause
import assert from "node:assert/strict";
import { test } from "node:test";
import { liveBlock, poseOf } from "../src/live";

test("a keyframe's block has a cube and points", () => {
  const bytes = new Uint8Array(32 + 13 * 2);
  const view = new DataView(bytes.buffer);
  [1, 2, 3, 8].forEach((value, i) => view.setFloat64(8 * i, value, true));
  view.setUint16(32 + 6, 65535, true); // x of the second point
  bytes[32 + 12 + 3] = 200; // its red
  bytes[32 + 18 + 1] = 128; // its confidence
  const block = liveBlock(bytes, 7);
  assert.deepEqual(block.corner, [1, 2, 3]);
  assert.equal(block.side, 8);
  assert.equal(block.points.count, 2);
  assert.equal(block.points.places[4], 65535);
  assert.equal(block.points.colors[4], 200);
  assert.equal(block.points.colors[7], 128);
  assert.deepEqual([...block.points.keyframes], [7, 7]);
  assert.throws(() => liveBlock(bytes.subarray(0, 40), 0), /40 bytes/);
  assert.throws(() => liveBlock(bytes.subarray(0, 16), 0), /16 bytes/);
});

test("a keyframe's pose follows from its matrix", () => {
  // Turned by a right angle about y, twice as large, at 1 2 3.
  const pose = poseOf([0, 0, 2, 1, 0, 2, 0, 2, -2, 0, 0, 3], [10, 0, 0]);
  assert.deepEqual(pose.center, [11, 2, 3]);
  assert.deepEqual(pose.rotation.map((x) => x + 0), [0, 0, -1, 0, 1, 0, 1, 0, 0]);
});
