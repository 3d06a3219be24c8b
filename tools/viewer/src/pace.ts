// SPDX-License-Identifier: BSD-2-Clause
// How many points are drawn: fewer while something moves and frames take long, all once it stands still.
import type { Cloud } from "./cloud";

const kSlowFrame = 28; // [ms]
const kMinPoints = 200_000;
const kMaxPoints = 5_000_000;

export class Pace {
  private movedAt = 0;
  private lastFrame = 0;
  private busy = false;

  moved(): void {
    this.movedAt = performance.now();
  }

  /** To be called before a frame. */
  frame(cloud: Cloud): void {
    const now = performance.now();
    this.busy = now - this.movedAt < 200;
    const took = now - this.lastFrame;
    if (this.busy && took < 250) {
      const { budget } = cloud;
      cloud.budget = took > kSlowFrame ? Math.max(kMinPoints, 0.8 * budget) : Math.min(kMaxPoints, 1.1 * budget);
    }
    this.lastFrame = now;
  }

  /** To be called after it. */
  settle(cloud: Cloud, draw: () => void): void {
    if (!this.busy || cloud.drawnPoints >= cloud.loaded) return;
    setTimeout(() => {
      if (performance.now() - this.movedAt < 250) return;
      const { budget } = cloud;
      cloud.budget = Number.POSITIVE_INFINITY;
      draw();
      cloud.budget = budget;
    }, 300);
  }
}
