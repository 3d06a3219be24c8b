// SPDX-License-Identifier: BSD-2-Clause
// Movements over some frames; with reduced motion they end at once.

const smooth = (t: number): number => t * t * (3 - 2 * t);

export class Motion {
  private frame = 0;
  private finish: (() => void) | null = null;

  get isActive(): boolean {
    return this.finish !== null;
  }

  /** Calls `step` with 0 to 1 over `duration` ms, then `done`. A motion in progress ends where it is. */
  run(duration: number, step: (t: number) => void, done: () => void = () => {}): void {
    this.stop();
    this.finish = done;
    if (matchMedia("(prefers-reduced-motion: reduce)").matches) {
      step(1);
      this.end();
      return;
    }
    const began = performance.now();
    const next = (now: number): void => {
      const t = Math.max(0, Math.min(1, (now - began) / duration));
      step(smooth(t));
      if (t < 1) this.frame = requestAnimationFrame(next);
      else this.end();
    };
    this.frame = requestAnimationFrame(next);
  }

  stop(): void {
    cancelAnimationFrame(this.frame);
    this.finish = null;
  }

  private end(): void {
    const done = this.finish;
    this.finish = null;
    done?.();
  }
}
