// SPDX-License-Identifier: BSD-2-Clause
import assert from "node:assert/strict";
import { test } from "node:test";
import type { NodePoints } from "../src/data";
import { angularSpacing, Detail, type DetailNode } from "../src/detail";
import type { Vec3 } from "../src/geometry";

/** A floor through the middle of the cube, `across` x `across` points. */
function floor(across: number): NodePoints {
  const count = across * across;
  const positions = new Uint16Array(4 * count);
  for (let i = 0; i < count; ++i) positions.set([(65535 * (i % across)) / across, (65535 * Math.floor(i / across)) / across, 100, 0], 4 * i);
  const none = new Uint8Array(4 * count);
  return { count, positions, colors: none, normalsAndViews: none, keyframes: new Uint16Array(count) };
}

/** As the vertex shader does it. */
function spacingAt(detail: Detail, node: DetailNode, place: Vec3): number {
  const values = detail.texture.image.data as Float32Array;
  let [index, at] = [node.index, [...place]];
  let found = values[4 * index + 2]!;
  for (;;) {
    const octant = at.reduce((sum, x) => 2 * sum + (x >= 0.5 ? 1 : 0), 0);
    const mask = values[4 * index]!;
    if ((mask & (1 << octant)) === 0) return found;
    let before = 0;
    for (let k = 0; k < octant; ++k) before += (mask >> k) & 1;
    index = values[4 * index + 1]! + before;
    at = at.map((x) => 2 * x - (x >= 0.5 ? 1 : 0));
    if (values[4 * index + 2]! > 0) found = values[4 * index + 2]!;
  }
}

const made = () => {
  const detail = new Detail();
  const root = detail.nodeOf(0, [0, 0, 0], 8)!;
  const child = detail.nodeOf(1, [4, 0, 0], 4)!;
  const grandchild = detail.nodeOf(2, [6, 2, 0], 2)!;
  return { detail, root, child, grandchild };
};

test("points are as large as the finest cube drawn at their place lets them be", () => {
  const { detail, root, child } = made();
  Detail.setPoints(root, floor(128));
  Detail.setPoints(child, floor(128));
  detail.show([root, child]);
  assert.equal(spacingAt(detail, root, [0.2, 0.2, 0]), Math.fround(root.spacing));
  assert.equal(spacingAt(detail, root, [0.8, 0.2, 0]), Math.fround(child.spacing));
  assert.ok(child.spacing < 0.6 * root.spacing, `${child.spacing} ${root.spacing}`);
  detail.show([root]);
  assert.equal(spacingAt(detail, root, [0.8, 0.2, 0]), Math.fround(root.spacing));
});

test("a cube whose parent is still loading has its own size, and so have the coarser points within it", () => {
  const { detail, root, child, grandchild } = made();
  Detail.setPoints(root, floor(128));
  Detail.setPoints(grandchild, floor(100));
  detail.show([root, grandchild]);
  const alone = grandchild.spacing;
  assert.ok(alone > 0 && alone < root.spacing / 3, `${alone} ${root.spacing}`);
  assert.equal(spacingAt(detail, grandchild, [0.1, 0.1, 0]), Math.fround(alone));
  assert.equal(spacingAt(detail, root, [0.8, 0.3, 0]), Math.fround(alone));
  assert.equal(spacingAt(detail, root, [0.6, 0.1, 0]), Math.fround(root.spacing));
  Detail.setPoints(child, floor(128));
  detail.show([root, child, grandchild]);
  assert.equal(spacingAt(detail, root, [0.6, 0.1, 0]), Math.fround(child.spacing));
  assert.ok(grandchild.spacing <= alone && grandchild.spacing > 0.5 * alone);
});

test("few points are larger than many, and points of coarser cubes count", () => {
  const { root, child } = made();
  Detail.setPoints(root, floor(128));
  Detail.setPoints(child, floor(10));
  assert.ok(child.spacing > root.spacing / 2 && child.spacing <= root.spacing);
  Detail.setPoints(child, floor(120));
  assert.ok(child.spacing < 0.7 * root.spacing);
});

test("cubes elsewhere have no place in the octree", () => {
  const { detail } = made();
  assert.equal(detail.nodeOf(1, [8, 0, 0], 4), null);
  assert.equal(new Detail().nodeOf(1, [0, 0, 0], 4), null);
});

test("strays in an empty cube are not drawn much larger than other points", () => {
  const { detail, root, child } = made();
  Detail.setPoints(root, floor(2));
  Detail.setPoints(child, floor(128));
  detail.show([root, child]);
  assert.ok(root.spacing > 10 * child.spacing, `${root.spacing} ${child.spacing}`);
  const drawn = spacingAt(detail, root, [0.2, 0.2, 0]);
  assert.ok(drawn <= 4.001 * child.spacing, `${drawn} ${child.spacing}`);
});

test("points of a keyframe are spaced evenly as its camera sees them, whatever share of the directions has points", () => {
  const count = 20_000;
  const eye: Vec3 = [0.4, 0.5, 0.6];
  const seen = (share: number): NodePoints => {
    const places: number[] = [];
    for (let i = 0; i < count; ++i) {
      const y = 1 - (2 * i + 1) / count; // Fibonacci's spiral
      const [across, turn] = [Math.sqrt(1 - y * y), i * 2.399963];
      const direction: Vec3 = [across * Math.sin(turn), y, across * Math.cos(turn)];
      if (direction[0] > 2 * share - 1) continue;
      const distance = 0.1 + 0.2 * (i % 2);
      places.push(...direction.map((x, k) => Math.round(65535 * (eye[k as 0] + distance * x))), 0);
    }
    const none = new Uint8Array(places.length);
    return { count: places.length / 4, positions: Uint16Array.from(places), colors: none, normalsAndViews: none, keyframes: new Uint16Array(places.length / 4) };
  };
  const truth = Math.sqrt((4 * Math.PI) / count);
  for (const share of [1, 0.5, 0.2]) {
    const ratio = angularSpacing(seen(share), eye) / truth;
    assert.ok(ratio > 0.55 && ratio < 0.7, `${ratio} with ${share} of the directions`);
  }
  assert.equal(angularSpacing(floor(0), eye), 0);
});
