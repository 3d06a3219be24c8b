// SPDX-License-Identifier: BSD-2-Clause
/** Does what is asked for often now and then: a moment after it is asked for, however often it is until then. */
export class Throttle {
  private timer = 0;

  constructor(
    private readonly pause: number,
    private readonly act: () => void,
  ) {}

  ask(): void {
    if (this.timer !== 0) return;
    this.timer = window.setTimeout(() => {
      this.timer = 0;
      this.act();
    }, this.pause);
  }
}
