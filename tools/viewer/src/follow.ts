// SPDX-License-Identifier: BSD-2-Clause
// The views from outside follow the camera of a run.
import type { Cameras } from "./cameras";
import { type Vec3, norm, sub } from "./geometry";

export class Follow {
  private camera: Vec3 | null = null;

  constructor(
    private readonly cameras: Cameras,
    public isOn: boolean,
  ) {}

  /** The camera has moved: the view moves with it. */
  moved(camera: Vec3): void {
    const before = this.camera;
    this.camera = camera;
    if (!this.isOn || (before && norm(sub(camera, before)) === 0)) return;
    if (before) this.cameras.shift(sub(camera, before));
    else this.center();
  }

  /** Moves the view until the camera is in its middle. */
  center(): void {
    const { target } = this.cameras;
    if (this.isOn && this.camera && target) this.cameras.shift(sub(this.camera, target));
  }
}
