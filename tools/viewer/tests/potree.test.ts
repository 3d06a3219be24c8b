// SPDX-License-Identifier: BSD-2-Clause
import assert from "node:assert/strict";
import { test } from "node:test";
import { kNoKeyframe } from "../src/data";
import { normalFrom } from "../src/geometry";
import { potreeFrom, potreePoints } from "../src/potree";

const attributes = [
  { name: "position", size: 12 },
  { name: "rgb", size: 6 },
  { name: "NormalX", size: 4 },
  { name: "NormalY", size: 4 },
  { name: "NormalZ", size: 4 },
  { name: "confidence", size: 4 },
  { name: "views", size: 1 },
];
const metadata = {
  version: "2.0",
  encoding: "DEFAULT",
  points: 3,
  offset: [10, 20, 30],
  scale: [0.01, 0.01, 0.01],
  boundingBox: { min: [9, 19, 29], max: [13, 23, 33] },
  attributes,
};

function hierarchy(nodes: [number, number, number, number, number][]): Uint8Array<ArrayBuffer> {
  const bytes = new Uint8Array(22 * nodes.length);
  const view = new DataView(bytes.buffer);
  nodes.forEach(([kind, mask, points, first, size], i) => {
    view.setUint8(22 * i, kind);
    view.setUint8(22 * i + 1, mask);
    view.setUint32(22 * i + 2, points, true);
    view.setBigUint64(22 * i + 6, BigInt(first), true);
    view.setBigUint64(22 * i + 14, BigInt(size), true);
  });
  return bytes;
}

const two = hierarchy([
  [0, 1 << 5, 1, 70, 35],
  [1, 0, 2, 0, 70],
]);

test("cubes of the octree lie where their numbers say", () => {
  const tree = potreeFrom(JSON.stringify(metadata), two, [10, 20, 30]);
  assert.deepEqual(tree.root.corner, [-1, -1, -1]);
  assert.equal(tree.root.side, 4);
  const child = tree.root.children[0];
  assert.deepEqual(child?.corner, [1, -1, 1]); // octant 5: x and z
  assert.equal(child?.side, 2);
  assert.equal(child?.points, 2);
  assert.equal(tree.pointBytes, 35);
});

test("a point comes as it was written", () => {
  const tree = potreeFrom(JSON.stringify(metadata), two, [10, 20, 30]);
  const bytes = new Uint8Array(35);
  const view = new DataView(bytes.buffer);
  [150, -50, 250].forEach((v, k) => view.setInt32(4 * k, v, true));
  [257 * 200, 257 * 100, 0].forEach((v, k) => view.setUint16(12 + 2 * k, v, true));
  [0.6, -0.64, -0.48].forEach((v, k) => view.setFloat32(18 + 4 * k, v, true));
  view.setFloat32(30, 0.5, true);
  view.setUint8(34, 7);
  const { count, positions, colors, normalsAndViews, keyframes } = potreePoints(tree, tree.root, bytes);
  assert.equal(count, 1);
  const at = [0, 1, 2].map((k) => (positions[k]! / 65535) * 4 - 1);
  [1.5, -0.5, 2.5].forEach((x, k) => assert.ok(Math.abs(at[k]! - x) < 1e-4));
  assert.deepEqual([...colors], [200, 100, 0, 128]);
  const signed = (v: number): number => (v << 24) >> 24;
  const normal = normalFrom(signed(normalsAndViews[0]!), signed(normalsAndViews[1]!));
  [0.6, -0.64, -0.48].forEach((x, k) => assert.ok(Math.abs(normal[k]! - x) < 0.02));
  assert.equal(normalsAndViews[2], 7);
  assert.equal(keyframes[0], kNoKeyframe);
});

test("what is no such cloud is refused", () => {
  const refused = (change: object, nodes = two): void => {
    assert.throws(() => potreeFrom(JSON.stringify({ ...metadata, ...change }), nodes, [0, 0, 0]));
  };
  refused({ encoding: "BROTLI" });
  refused({ version: "1.8" });
  refused({ attributes: attributes.slice(1) });
  refused({ boundingBox: { min: [0, 0, 0] } });
  refused({ offset: "here" });
  refused({}, two.slice(0, 30));
  refused({}, hierarchy([[2, 0, 1, 0, 35]]));
  assert.throws(() => potreeFrom("{", two, [0, 0, 0]));
  const tree = potreeFrom(JSON.stringify(metadata), two, [0, 0, 0]);
  assert.throws(() => potreePoints(tree, tree.root, new Uint8Array(34)));
});
