// SPDX-License-Identifier: BSD-2-Clause
import assert from "node:assert/strict";
import { test } from "node:test";
import type { Vec3 } from "../src/geometry";
import { type Calibration, convertCommand, hasUnits, lengthFrom, scaleOf } from "../src/lengths";
import { type Picked, resultOf } from "../src/measure";

const picked = (position: Vec3, spread = 0): Picked => ({ position, confidence: 1, keyframe: -1, spread });
const about = { up: [0, 0, 1] as Vec3, reach: 0, camera: () => null };
/** 4 units are 2 m. */
const known: Calibration = { points: [picked([0, 0, 0]), picked([0, 4, 0])], metres: 2, rounding: 0 };

test("lengths are read in metres, feet and inches", () => {
  const metres = (text: string, otherwise: "m" | "ft" = "m"): number | undefined => lengthFrom(text, otherwise)?.metres;
  assert.equal(metres("2.01"), 2.01);
  assert.equal(metres(" 2,01 m "), 2.01);
  assert.equal(metres("10", "ft"), 3.048);
  assert.equal(metres("10 ft"), 3.048);
  assert.equal(metres("10'"), 3.048);
  assert.ok(Math.abs(metres("6' 7\"")! - 79 * 0.0254) < 1e-12);
  for (const text of ["", "0", "-2", "2.01 mm", "1e3", "Infinity", "2 m m", "<b>2</b>", "9".repeat(400)]) assert.equal(metres(text), undefined, text);
});

test("a known length is as exact as its last digit", () => {
  assert.equal(lengthFrom("2.01", "m")?.rounding, 0.005);
  assert.equal(lengthFrom("2", "m")?.rounding, 0.5);
  assert.ok(Math.abs(lengthFrom("6' 7\"", "m")!.rounding - 0.0127) < 1e-12);
});

test("a known length scales lengths, areas and errors, angles stay", () => {
  const scale = scaleOf("map units", known, null, about);
  assert.deepEqual([scale.unit, scale.factor], ["m", 0.5]);
  const square = [[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]].map((p) => picked(p as unknown as Vec3));
  const value = (kind: "distance" | "angle" | "area", count: number): number => resultOf({ kind, points: square.slice(0, count) }, { ...about, scale }).value;
  assert.ok(Math.abs(value("distance", 2) - 2) < 1e-9);
  assert.ok(Math.abs(value("area", 4) - 4) < 1e-9);
  assert.equal(value("angle", 3), 90);
});

test("the error of a known length is part of what follows from it", () => {
  const unsure: Calibration = { points: [picked([0, 0, 0], 0.04), picked([0, 4, 0], 0.03)], metres: 2, rounding: 0.05 };
  const scale = scaleOf("map units", unsure, null, about);
  assert.ok(Math.abs(scale.relativeError - Math.hypot(0.05 / 4, 0.05 / 2)) < 1e-6, `${scale.relativeError}`);
  const ten = { kind: "distance" as const, points: [picked([0, 0, 0]), picked([20, 0, 0])] };
  const { value, error, text } = resultOf(ten, { ...about, scale });
  assert.ok(Math.abs(error - value * scale.relativeError) < 1e-9);
  assert.match(text, /^10\.00 ± 0\.28 m$/);
});

test("lengths are in the unit of the cloud unless another is wanted and known", () => {
  assert.deepEqual(scaleOf("map units", null, "ft", about), { unit: "map units", factor: 1, relativeError: 0 });
  assert.deepEqual(scaleOf("m", null, null, about), { unit: "m", factor: 1, relativeError: 0 });
  assert.ok(Math.abs(scaleOf("m", null, "ft", about).factor - 1 / 0.3048) < 1e-12);
  assert.ok(Math.abs(scaleOf("ft", null, "m", about).factor - 0.3048) < 1e-12);
  assert.ok(Math.abs(scaleOf("m", known, "ft", about).factor - 0.5 / 0.3048) < 1e-12);
  assert.equal(hasUnits("map units", null), false);
  assert.equal(hasUnits("map units", known), true);
});

test("the command has the points in the frame of the cloud, and no name escapes its quotes", () => {
  assert.equal(
    convertCommand("out/cloud.ply", known, [100, -2, 0.5]),
    "pmsp-densify convert out/cloud.ply -o metres.ply --length 100,-2,0.5 100,2,0.5 2",
  );
  assert.match(convertCommand("a b'; rm -rf ~; '.ply", known, [0, 0, 0]), /convert 'a b'\\''; rm -rf ~; '\\''\.ply' -o/);
  assert.match(convertCommand("-x.ply\n$(id)", known, [0, 0, 0]), /convert '\.\/-x\.ply\?\$\(id\)' -o/);
});
