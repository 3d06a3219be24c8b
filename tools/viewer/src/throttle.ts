// SPDX-License-Identifier: BSD-2-Clause
/** Runs `act` once, `pause` ms after the first of several requests. */
export class Throttle {
  private timer: ReturnType<typeof setTimeout> | null = null;

  constructor(
    private readonly pause: number,
    private readonly act: () => void,
  ) {}

  request(): void {
    this.timer ??= setTimeout(() => {
      this.timer = null;
      this.act();
    }, this.pause);
  }
}
