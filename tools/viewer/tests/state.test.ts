// SPDX-License-Identifier: BSD-2-Clause
import assert from "node:assert/strict";
import { test } from "node:test";
import { initialState, stateFrom, stateText } from "../src/state";

test("a view comes back from the address", () => {
  const state = initialState();
  state.mode = "keyframe";
  state.coloring = "views";
  state.eye = [1, -2, 3.25];
  state.target = [0, 0, 0];
  state.keyframe = 7;
  state.fade = 0.25;
  state.cut = [-1.5, 2, null, null, null, 0.5];
  state.measurements.push({
    kind: "distance",
    points: [
      { position: [0, 1, 2], confidence: 0.5, keyframe: 3, spread: 0.03 },
      { position: [4, 5, 6], confidence: 0.25, keyframe: -1, spread: 0 },
    ],
  });
  state.notes.push({ position: [1, 2, 3], text: "door; & <b>50 %</b>" });
  assert.deepEqual(stateFrom(`#${stateText(state)}`), state);
});

test("a cut of an old address, in shares, comes back as it is", () => {
  const state = stateFrom("clip=0.1,2,0,1,0,0.5");
  assert.deepEqual(state.clip, [0.1, 1, 0, 1, 0, 0.5]);
  assert.deepEqual(stateFrom(stateText(state)), state);
  assert.ok(state.isAlongPath && stateFrom("axes=path&cut=1,2,,,,").isAlongPath);
  assert.ok(!stateFrom("clip=0,1,0,1,0,0.5").isAlongPath);
  assert.deepEqual(stateFrom("cut=1,2,x,,,1e99").cut, [1, 2, null, null, null, null]);
});

test("nothing in the address means the beginning", () => {
  assert.deepEqual(stateFrom(""), initialState());
  assert.equal(stateText(initialState()), "");
});

test("what makes no sense is left out", () => {
  const words = [
    "view=up&color=red&fade=x&keyframe=-5&clip=1,2&zoom=NaN",
    "eye=1,2&at=3,4,5",
    "eye=1,2,1e99&at=3,4,5",
    "distance=1,2,3,0.5,0",
    "distance=1,2,3,0.5,0;1,2,,0,0",
    "area=1,1,1,1,1;2,2,2,1,1",
    "note=5&note=1,2;text&note=;",
    "%E0%A4%A&=&&&",
  ];
  for (const text of words) assert.deepEqual(stateFrom(text), initialState(), text);
});

test("an area of too many corners is left out, not cut", () => {
  const area = (corners: number): number => stateFrom(`area=${Array.from({ length: corners }, (_, i) => `${i},0,0,1,0,0`).join(";")}`).measurements.length;
  assert.deepEqual([area(100), area(101)], [1, 0]);
});

test("numbers are kept in their bounds", () => {
  const state = stateFrom("fade=7&size=100&keyframe=3.6&clip=-1,2,0,1,0,1");
  assert.equal(state.fade, 1);
  assert.equal(state.size, 5);
  assert.equal(state.keyframe, 4);
  assert.equal(state.clip, null); // nothing is cut
});
