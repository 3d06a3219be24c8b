// SPDX-License-Identifier: BSD-2-Clause
import assert from "node:assert/strict";
import { test } from "node:test";
import { deflateSync } from "node:zlib";
import { type View, bestPhoto, sees } from "../src/best_photo";
import { Depths } from "../src/depths";
import { type Vec3, norm, sub, unit } from "../src/geometry";
import type { Picked } from "../src/measure";
import { type Photo, kNoDepth, kOpenEdge, pickedInPhoto, placesInPhoto } from "../src/photo_pick";

const [kWidth, kHeight] = [128, 64];

function stored(width: number, height: number, least: number, planes: Uint8Array): Uint8Array {
  const header = Buffer.alloc(16);
  header.writeUInt32LE(width, 0);
  header.writeUInt32LE(height, 4);
  header.writeDoubleLE(least, 8);
  return Buffer.concat([header, deflateSync(planes)]);
}

/** A depth map as tools/pmsp-densify/report/page_depth.h lays it out. */
function depthsOf(depth: (ray: Vec3, column: number, row: number) => number, width = kWidth, height = kHeight): Depths {
  const blank = new Depths(stored(width, height, 1, new Uint8Array(3 * width * height)));
  const all = Array.from({ length: width * height }, (_, i) => depth(blank.rayOf(i % width, Math.floor(i / width)), i % width, Math.floor(i / width)));
  const least = Math.min(...all.filter((d) => d > 0));
  const planes = new Uint8Array(3 * all.length);
  let previous = 0;
  all.forEach((d, i) => {
    if (d === 0) return;
    const code = Math.round(1024 * Math.log(d / least));
    const folded = code >= previous ? 2 * (code - previous) : 2 * (previous - code) - 1;
    previous = code;
    planes.set([folded & 255], i);
    planes.set([folded >> 8], all.length + i);
    planes.set([12], 2 * all.length + i);
  });
  return new Depths(stored(width, height, least, planes));
}
const identity = [1, 0, 0, 0, 1, 0, 0, 0, 1];
const photoOf = (depths: Depths, keyframe = 0, center: Vec3 = [0, 0, 0]): Photo => ({ depths, pose: { center, rotation: identity }, keyframe, lensDistance: 0 });
/** Along a ray, to the wall z = 4, seen from z. */
const wall = (ray: Vec3, z = 0): number => (ray[2] > 0.2 ? (4 - z) / ray[2] : 0);

function pick(photo: Photo, direction: Vec3): Picked {
  const found = pickedInPhoto(photo, direction);
  if (typeof found === "string") assert.fail(found);
  return found;
}

test("depths come back within a twentieth of a percent, none stays none", () => {
  const depths = depthsOf((ray, column) => (column % 5 === 0 ? 0 : 1.5 + 40 * (1 + ray[0])));
  for (let column = 0; column < kWidth; ++column) {
    const truth = column % 5 === 0 ? 0 : 1.5 + 40 * (1 + depths.rayOf(column, 9)[0]);
    assert.ok(Math.abs(depths.at(column, 9) - truth) <= 5.2e-4 * truth);
  }
  assert.equal(depths.at(-1, 9), depths.at(kWidth - 1, 9), "columns wrap around");
  assert.equal(depths.at(1, -1), 0);
  assert.equal(depths.at(1, kHeight), 0);
});

test("what is no depth map, or one of another size, is refused", () => {
  const good = stored(4, 2, 1, new Uint8Array(24));
  assert.equal(new Depths(good).width, 4);
  const cut = [good.subarray(0, 16), new Uint8Array(5), new Uint8Array(0)];
  for (const bytes of [stored(4, 2, 1, new Uint8Array(23)), stored(4, 2, 0, new Uint8Array(24)), stored(0, 2, 1, new Uint8Array(24)), stored(2 ** 16, 2 ** 15, 1, new Uint8Array(24)), ...cut]) {
    assert.throws(() => new Depths(bytes), /damaged/);
  }
});

test("a click in a photo takes the depth at that pixel", () => {
  const photo = photoOf(depthsOf((ray) => wall(ray)));
  const found = pick(photo, unit([0.5, -0.3, 1]));
  assert.ok(Math.abs(found.position[2] - 4) < 0.1, `${found.position}`);
  assert.ok(norm(sub(unit(found.position), unit([0.5, -0.3, 1]))) < 1e-9, "on the ray of the click");
  assert.deepEqual([found.keyframe, found.confidence], [0, (12 / 15) ** 2]);
  assert.equal(pickedInPhoto(photo, [0, 0, -1]), kNoDepth);
});

test("lenses in front of and behind the centre move the place", () => {
  const photo = { ...photoOf(depthsOf((ray) => (Math.abs(ray[2]) > 0.2 ? 2 : 0))), lensDistance: 0.2 };
  assert.ok(Math.abs(pick(photo, [0, 0, 1]).position[2] - 2.1) < 0.01);
  assert.ok(Math.abs(pick(photo, [0, 0, -1]).position[2] + 2.1) < 0.01);
});

test("beside a step in depth a point is known worse", () => {
  const photo = photoOf(depthsOf((ray) => (ray[0] > 0 ? wall(ray) : wall(ray) / 2)));
  const spread = (x: number): number => pick(photo, unit([x, 0, 1])).spread;
  assert.ok(spread(0.05) > 1, `${spread(0.05)}`);
  assert.ok(spread(0.8) < 0.4, `${spread(0.8)}`);
});

test("a hole is closed where all around is one surface; a stray depth is none", () => {
  const at = (hole: (column: number, row: number) => number | null): Picked | string =>
    pickedInPhoto(photoOf(depthsOf((ray, c, r) => hole(c, r) ?? wall(ray))), unit([0.02, 0.02, 1]));
  const [column, row] = [64, 32]; // of the click
  const closed = at((c, r) => (Math.hypot(c - column, r - row) < 1.5 ? 0 : null));
  assert.ok(typeof closed !== "string" && Math.abs(closed.position[2] - 4) < 0.1);
  assert.equal(at((c, r) => (Math.hypot(c - column, r - row) < 4 ? 0 : null)), kNoDepth);
  assert.equal(at((c) => (c === column ? 0 : c > column ? 9 : null)), kNoDepth, "two surfaces");
  const stray = at((c, r) => (c === column && r === row ? 1 : null));
  assert.ok(typeof stray !== "string" && Math.abs(stray.position[2] - 4) < 0.1);
});

test("at an edge beyond which nothing is known a click is refused, inside it is not", () => {
  const photo = photoOf(depthsOf((ray, c) => (c > 64 ? 0 : wall(ray))));
  assert.equal(pickedInPhoto(photo, photo.depths.rayOf(64, 32)), kOpenEdge);
  assert.equal(typeof pickedInPhoto(photo, photo.depths.rayOf(57, 32)), "object");
});

test("places around one are those of its surface", () => {
  const photo = photoOf(depthsOf((ray) => (ray[0] > 0 ? wall(ray) : wall(ray) / 2)));
  const places = placesInPhoto(photo, [0.1, 0, 4], 6);
  assert.ok(places.length > 20);
  assert.ok(places.every((p) => Math.abs(p[2] - 4) < 0.01));
});

const opened: number[] = [];
const viewOf = (photo: Photo): View => ({ pose: photo.pose, open: () => (opened.push(photo.keyframe), Promise.resolve(photo)) });
const best = async (photos: Photo[], place: Vec3, normal: Vec3 | null): Promise<number | undefined> =>
  (await bestPhoto(photos.map(viewOf), place, normal))?.keyframe;

test("the best photo is near and faces the surface; a flat angle ranks low but counts", async () => {
  const at = (x: number, z: number, keyframe: number): Photo => photoOf(depthsOf((ray) => wall(ray, z)), keyframe, [x, 0, z]);
  const [near, far, flat] = [at(0, 2, 1), at(0, 0, 2), at(3.9, 3, 3)];
  const place: Vec3 = [0.2, 0, 4];
  const normal: Vec3 = [0, 0, 1];
  assert.equal(await best([far, near, flat], place, normal), 1);
  assert.deepEqual(opened, [1], "the others are not fetched");
  assert.equal(await best([far, flat], place, normal), 2);
  assert.equal(await best([flat], place, normal), 3);
  const gone: View = { pose: near.pose, open: () => Promise.resolve(null) };
  assert.equal((await bestPhoto([gone, viewOf(far)], place, normal))?.keyframe, 2);
});

test("a photo in which something stands before the point does not see it", async () => {
  const hidden = photoOf(depthsOf((ray) => wall(ray) / 2));
  const through = photoOf(depthsOf((ray) => 2 * wall(ray)));
  const open = photoOf(depthsOf((ray) => wall(ray)), 5, [0, 0, 0]);
  for (const photo of [hidden, through]) assert.equal(sees(photo, [0, 0, 4]), false);
  assert.equal(sees(open, [0, 0, 4]), true);
  assert.equal(sees(open, [0, 0, -4]), false, "no depth there");
  assert.equal(await best([hidden, through], [0, 0, 4], null), undefined);
  assert.equal(await best([hidden, open, through], [0, 0, 4], null), 5);
});
