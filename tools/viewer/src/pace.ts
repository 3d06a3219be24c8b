// SPDX-License-Identifier: BSD-2-Clause
// Number of points per frame, from the measured time of frames.

const kFrameTime = 50; // [ms]
const kFewest = 50_000;
const kMost = 20_000_000;

export class Pace {
  /** Points of a frame that takes kFrameTime. */
  budget = 300_000;
  /** Time of a frame without points [ms]. */
  private base = 0;

  /** A frame of so many points took `time` ms. */
  took(points: number, time: number): void {
    if (points === 0) {
      this.base += 0.3 * (time - this.base);
      return;
    }
    const base = Math.min(this.base, 0.6 * kFrameTime);
    const factor = Math.max(0.3, Math.min(1.5, (kFrameTime - base) / Math.max(time - base, 1)));
    // A small frame that was fast does not show that a large one would be.
    if (factor > 1 && points < 0.8 * this.budget) return;
    const wanted = factor < 1 ? factor * Math.min(points, this.budget) : factor * this.budget;
    this.budget = Math.max(kFewest, Math.min(kMost, wanted));
  }
}
