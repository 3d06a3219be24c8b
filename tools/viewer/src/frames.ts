// SPDX-License-Identifier: BSD-2-Clause
// When to draw, and how much: few points while something moves, then step by step all of them.
import type { Cube } from "./cloud";
import { Pace } from "./pace";

/** Rest before more points are drawn [ms]. */
const kRest = 150;
/** Points of a step, times those of the previous step. */
const kGrowth = 4;

export interface Painter {
  /** Begins a picture: returns cubes with at most `budget` points, and whether these are all in view. */
  begin: (budget: number) => { cubes: Cube[]; isAll: boolean };
  /** Draws cubes. */
  add: (cubes: readonly Cube[]) => void;
  /** Shows the picture. */
  present: () => void;
  /** The full picture is shown. */
  completed: () => void;
  /** Calls `done` when the GPU has finished, with the time since [ms]. */
  whenFinished: (done: (time: number) => void) => void;
}

const countOf = (cubes: readonly Cube[]): number => cubes.reduce((sum, it) => sum + (it.points?.count ?? 0), 0);

export class Frames {
  readonly pace = new Pace();
  /** Points of the picture shown. */
  shownPoints = 0;
  /** Steps towards the full picture, for tests. */
  steps = 0;
  private isMoved = true;
  private isOutdated = false;
  private isComplete = false;
  private isBusy = false;
  private isRequested = false;
  private movedAt = 0;
  private restTimer: ReturnType<typeof setTimeout> | null = null;
  private level = 0;
  private work: { cubes: Cube[]; next: number; isAll: boolean } | null = null;
  private readonly held = new Set<number>();

  constructor(private readonly painter: Painter) {}

  /** Pointers on the picture delay the full picture. */
  listen(canvas: HTMLCanvasElement): void {
    canvas.addEventListener("pointerdown", (event) => this.held.add(event.pointerId));
    window.addEventListener("blur", () => {
      this.held.clear();
      this.request();
    });
    for (const name of ["pointerup", "pointercancel"] as const) {
      window.addEventListener(name, (event) => {
        this.held.delete(event.pointerId);
        this.request();
      });
    }
  }

  /** Whether the full picture is shown and nothing is in flight. */
  get isIdle(): boolean {
    return this.isComplete && !this.isMoved && !this.isOutdated && !this.isBusy && !this.work;
  }

  /** The view has changed. */
  moved(): void {
    this.movedAt = performance.now();
    this.isMoved = true;
    this.request();
  }

  /** The points have changed, not the view: what is shown stays until a better picture is complete. */
  outdated(): void {
    this.isOutdated = true;
    this.request();
  }

  /** What cubes were prepared for was drawn otherwise: a picture in progress begins again. */
  restart(): void {
    if (!this.work) return;
    this.work = null;
    this.level /= kGrowth;
    this.request();
  }

  /** Draws all points now. */
  drawAll(): void {
    const { cubes } = this.painter.begin(Number.POSITIVE_INFINITY);
    this.painter.add(cubes);
    this.shown(countOf(cubes), true);
  }

  /** Draws now what takes one frame. */
  drawFew(): void {
    const { cubes, isAll } = this.painter.begin(this.pace.budget);
    this.level = this.pace.budget;
    this.painter.add(cubes);
    this.shown(countOf(cubes), isAll);
  }

  private shown(points: number, isComplete: boolean): void {
    this.isMoved = this.isOutdated = false;
    this.work = null;
    this.shownPoints = points;
    this.isComplete = isComplete;
    this.painter.present();
    if (isComplete) this.painter.completed();
  }

  private request(): void {
    if (this.isRequested) return;
    this.isRequested = true;
    requestAnimationFrame(() => {
      this.isRequested = false;
      if (!this.isBusy) this.frame();
    });
  }

  private frame(): void {
    if (this.isMoved) {
      this.drawFew();
      this.measure(this.shownPoints);
      return;
    }
    if (this.isComplete && !this.isOutdated && !this.work) return;
    const wait = this.movedAt + kRest - performance.now();
    if (this.held.size > 0) return; // until it is released
    if (wait > 0) {
      this.restTimer ??= setTimeout(() => {
        this.restTimer = null;
        this.request();
      }, wait + 1);
      return;
    }
    this.step();
  }

  /** A part of the next picture, which is shown once it is complete. */
  private step(): void {
    this.steps += 1;
    if (!this.work) {
      this.level = Math.max(this.isOutdated ? this.level : kGrowth * this.level, this.pace.budget);
      this.isOutdated = false;
      this.work = { ...this.painter.begin(this.level), next: 0 };
    }
    const { work } = this;
    if (work.next === work.cubes.length) {
      const wasOutdated = this.isOutdated;
      this.shown(countOf(work.cubes), work.isAll);
      this.isOutdated = wasOutdated;
      this.measure(0);
      return;
    }
    const part: Cube[] = [];
    for (let sum = 0; work.next < work.cubes.length; ++work.next) {
      const cube = work.cubes[work.next]!;
      sum += cube.points?.count ?? 0;
      if (sum > this.pace.budget && part.length > 0) break;
      part.push(cube);
    }
    this.painter.add(part);
    this.measure(countOf(part));
  }

  private measure(points: number): void {
    this.isBusy = true;
    this.painter.whenFinished((time) => {
      this.isBusy = false;
      if (time > 0) this.pace.took(points, time);
      this.request();
    });
  }
}
