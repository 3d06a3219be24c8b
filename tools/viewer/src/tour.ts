// SPDX-License-Identifier: BSD-2-Clause
// From keyframe to keyframe, and the pivot of the views from outside.
import type { Cameras } from "./cameras";
import { type Vec3, add, sub, times } from "./geometry";
import { Motion } from "./motion";
import type { Mode, ViewState } from "./state";
import { type KeyframePlace, keyframeTowards, stepFrom } from "./trajectory";

const kStepTime = 400; // [ms]
/** Of the extent, or of the distance to the pivot [1/s]. */
const kWalkSpeed = 0.2;
/** Beside keyframes that are brought into the picture [px]. */
const kMargin = 40;

export const isOutside = (mode: Mode): boolean => mode === "orbit" || mode === "plan";

interface TourStops {
  /** Existing keyframes, in the order of the trajectory. */
  places: () => KeyframePlace[];
  /** Indices of those that steps go to in a mode. */
  path: (mode: Mode) => number[];
  /** Stands at a keyframe. */
  enter: (which: number) => void;
  /** Loads its photo, where the mode shows photos. */
  prepare: (which: number) => void;
  /** Another keyframe is the current one, from outside. */
  marked: () => void;
}

export class Tour {
  private readonly motion = new Motion();

  constructor(
    private readonly cameras: Cameras,
    private readonly state: ViewState,
    private readonly stops: TourStops,
  ) {}

  get isMoving(): boolean {
    return this.motion.isActive;
  }

  stop(): void {
    this.motion.stop();
  }

  private glide(from: Vec3, to: Vec3, act: (at: Vec3) => void, done: () => void = () => {}): void {
    this.motion.run(kStepTime, (t) => act(add(from, times(sub(to, from), t))), done);
  }

  /** The next or previous keyframe of the trajectory. */
  step(by: number): void {
    const { places, path } = this.stops;
    const next = stepFrom(places().map((it) => it.index), path(this.state.mode), this.state.keyframe, by);
    if (next !== undefined) this.goTo(next);
  }

  /** Goes to a keyframe from another one; from outside it is marked, and brought into the picture. */
  goTo(which: number): void {
    const { cameras, state, stops } = this;
    const to = stops.places().find((it) => it.index === which)?.center;
    if (!to) return;
    state.keyframe = which;
    if (!isOutside(state.mode)) {
      stops.prepare(which);
      this.glide(cameras.eye, to, (at) => cameras.standAt(at), () => stops.enter(which));
      return;
    }
    if (!cameras.isInPicture(to, kMargin)) this.glide(cameras.target ?? to, to, (at) => cameras.center(at));
    stops.marked();
  }

  /** From outside, turns around a place from now on. */
  turnAround(place: Vec3): void {
    const { cameras } = this;
    this.glide(cameras.target ?? place, place, (at) => cameras.setPivot(at));
  }

  /** Right, ahead and up. In a photo to the next keyframe that way, since elsewhere it would not fit the points. */
  walk(by: Vec3): void {
    if (this.state.mode !== "keyframe") {
      this.cameras.walk(times(by, kWalkSpeed));
      return;
    }
    if (this.isMoving) return;
    const able = new Set(this.stops.path("keyframe"));
    const places = this.stops.places().filter((it) => able.has(it.index));
    const next = keyframeTowards(places, this.cameras.eye, this.cameras.directionOf(by[0], by[1]));
    if (next >= 0) this.goTo(next);
  }
}
