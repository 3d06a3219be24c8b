// SPDX-License-Identifier: BSD-2-Clause
import assert from "node:assert/strict";
import { test } from "node:test";
import type { Cube } from "../src/cloud";
import { Frames, type Painter } from "../src/frames";
import { Pace } from "../src/pace";

test("the budget follows the machine, down until frames are fluent and up again", () => {
  const pace = new Pace();
  const run = (perMillion: number, base: number): number => {
    for (let i = 0; i < 40; ++i) {
      pace.took(0, base);
      pace.took(pace.budget, base + (perMillion * pace.budget) / 1e6);
    }
    return base + (perMillion * pace.budget) / 1e6;
  };
  assert.ok(run(300, 5) < 60, `${pace.budget}`);
  assert.ok(pace.budget > 100_000);
  assert.ok(run(3, 2) < 60 && pace.budget > 5_000_000, `${pace.budget}`);
  assert.ok(run(300, 5) < 60);
  run(10, 200); // frames without points are slow already: fewer points do not help
  assert.ok(pace.budget >= 50_000);
});

test("a small frame that is fast does not raise the budget", () => {
  const pace = new Pace();
  const before = pace.budget;
  for (let i = 0; i < 10; ++i) pace.took(100, 1);
  assert.equal(pace.budget, before);
});

const cubes = Array.from({ length: 50 }, () => ({ points: { count: 40_000 } }) as Cube);

/** A picture of two million points on a machine that takes 300 ms for a million. */
class SlowPainter implements Painter {
  readonly shown: number[] = [];
  added = 0;
  private waiting: (() => void)[] = [];
  begin(budget: number): { cubes: Cube[]; isAll: boolean } {
    this.added = 0;
    const count = Math.max(1, Math.min(cubes.length, Math.floor(budget / 40_000)));
    return { cubes: cubes.slice(0, count), isAll: count === cubes.length };
  }
  add(some: readonly Cube[]): void {
    this.added += some.length * 40_000;
  }
  present(): void {
    this.shown.push(this.added);
  }
  completed(): void {}
  whenFinished(done: (time: number) => void): void {
    const time = (300 * this.added) / 1e6;
    this.waiting.push(() => done(time));
    setImmediate(() => this.waiting.shift()?.());
  }
}

function prepare(): { frames: Frames; painter: SlowPainter; canvas: EventTarget } {
  const globals = globalThis as unknown as Record<string, unknown>;
  globals["window"] = new EventTarget();
  globals["requestAnimationFrame"] = (act: () => void) => setImmediate(act);
  const painter = new SlowPainter();
  const frames = new Frames(painter);
  const canvas = new EventTarget();
  frames.listen(canvas as HTMLCanvasElement);
  return { frames, painter, canvas };
}
const pointer = (type: string): Event => Object.assign(new Event(type), { pointerId: 1 });
async function until(condition: () => boolean): Promise<void> {
  while (!condition()) await new Promise((done) => setTimeout(done, 5));
}

test("a full picture comes step by step once nothing moves, never while a pointer is down", async () => {
  const { frames, painter, canvas } = prepare();
  canvas.dispatchEvent(pointer("pointerdown"));
  for (let i = 0; i < 20; ++i) {
    const before = painter.shown.length;
    frames.moved();
    await until(() => painter.shown.length > before);
  }
  await new Promise((done) => setTimeout(done, 200)); // longer than the rest that a full picture waits for
  assert.equal(frames.steps, 0);
  assert.ok(painter.shown.at(-1)! < 200_000 && !frames.isIdle, `${painter.shown}`);
  window.dispatchEvent(pointer("pointerup"));
  await until(() => frames.isIdle);
  assert.equal(painter.shown.at(-1), 2_000_000);
  assert.ok(frames.steps > 5);
});

test("a picture begun again, as after a resize, becomes full", async () => {
  const { frames, painter } = prepare();
  frames.moved();
  await until(() => frames.isIdle);
  frames.drawFew();
  assert.ok(painter.shown.at(-1)! < 2_000_000);
  frames.moved();
  await until(() => frames.isIdle);
  assert.equal(painter.shown.at(-1), 2_000_000);
});

test("points that come meanwhile do not thin out what is shown", async () => {
  const { frames, painter } = prepare();
  frames.moved();
  await until(() => frames.isIdle);
  const before = painter.shown.length;
  frames.outdated();
  await until(() => frames.isIdle && painter.shown.length > before);
  assert.deepEqual(painter.shown.slice(before).filter((count) => count < 2_000_000), []);
});
