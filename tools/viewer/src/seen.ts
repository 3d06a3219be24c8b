// SPDX-License-Identifier: BSD-2-Clause
// What a live map has not seen yet: cells of the plan that no sight from a keyframe to one of its points crosses, and
// landmarks without dense points around.
import type { Cloud } from "./cloud";
import { type Vec3, add, dot, times } from "./geometry";
import { Throttle } from "./throttle";

const kCells = 96; // along the longer side of the plan
const kVoxels = 80; // along the diagonal of the cloud
const kMaxPoints = 150_000; // that are looked at
const kPause = 1500; // [ms]

/** Cells of the plan, row by row; `low`: coordinates of the first corner along the first two axes of the basis. */
interface PlanGrid {
  low: readonly [number, number];
  cell: number;
  columns: number;
  rows: number;
  /** 1 = seen */
  seen: Uint8Array<ArrayBuffer>;
}

export function planGrid(low: Vec3, high: Vec3): PlanGrid {
  const cell = Math.max(high[0] - low[0], high[1] - low[1], 1e-9) / kCells;
  const columns = Math.max(1, Math.ceil((high[0] - low[0]) / cell - 1e-6));
  const rows = Math.max(1, Math.ceil((high[1] - low[1]) / cell - 1e-6));
  return { low: [low[0], low[1]], cell, columns, rows, seen: new Uint8Array(columns * rows) };
}

/** Marks the cells between an eye and a point as seen, up to the end of the plan. */
export function markSight(grid: PlanGrid, eye: readonly [number, number], point: readonly [number, number]): void {
  const place = (p: readonly [number, number], k: 0 | 1): number => (p[k] - grid.low[k]) / grid.cell;
  const [x, y] = [place(eye, 0), place(eye, 1)];
  const [dx, dy] = [place(point, 0) - x, place(point, 1) - y];
  const steps = Math.max(1, Math.ceil(2 * Math.max(Math.abs(dx), Math.abs(dy))));
  for (let i = 0; i <= steps; ++i) {
    const column = Math.floor(x + (dx * i) / steps);
    const row = Math.floor(y + (dy * i) / steps);
    if (column < 0 || row < 0 || column >= grid.columns || row >= grid.rows) return;
    grid.seen[row * grid.columns + column] = 1;
  }
}

/** Stretches of unseen cells: row, first column, number. */
export function unseenRuns(grid: PlanGrid): [number, number, number][] {
  const runs: [number, number, number][] = [];
  for (let row = 0; row < grid.rows; ++row) {
    for (let column = 0; column < grid.columns; ) {
      const first = column;
      while (column < grid.columns && grid.seen[row * grid.columns + column] === 0) ++column;
      if (column > first) runs.push([row, first, column - first]);
      else ++column;
    }
  }
  return runs;
}

const voxelOf = (p: Vec3, side: number): number =>
  Math.imul(Math.floor(p[0] / side), 73856093) ^ Math.imul(Math.floor(p[1] / side), 19349663) ^ Math.imul(Math.floor(p[2] / side), 83492791);

type Project = (p: Vec3) => [number, number] | null;

export class Seen {
  /** Landmarks without dense points around. */
  landmarks: readonly Vec3[] = [];
  grid: PlanGrid | null = null;
  private readonly later = new Throttle(kPause, () => {
    this.update();
    this.redraw();
  });

  /** `eyes`: centres of the keyframes by id. `all`: landmarks. */
  constructor(
    private readonly cloud: Cloud,
    private readonly eyes: () => Iterable<[string, Vec3]>,
    private readonly all: () => readonly Vec3[],
    private readonly redraw: () => void,
  ) {}

  /** Points, keyframes or landmarks have changed; the picture follows a moment later. */
  changed(): void {
    if (this.cloud.loaded === 0) this.landmarks = this.all();
    this.later.request();
  }

  private update(): void {
    const { cloud } = this;
    const [a, b] = cloud.basis;
    const flat = (p: Vec3): [number, number] => [dot(a, p), dot(b, p)];
    const grid = planGrid(cloud.low, cloud.high);
    const side = Math.hypot(...cloud.high.map((x, i) => x - (cloud.low[i] ?? 0))) / kVoxels || 1;
    const filled = new Set<number>();
    const stride = Math.max(1, Math.ceil(cloud.loaded / kMaxPoints));
    for (const [id, eye] of this.eyes()) {
      const cube = cloud.keyframeCubes.get(id);
      if (!cube) continue;
      const from = flat(eye);
      cloud.visit(
        cube,
        (x, y, z) => {
          filled.add(voxelOf([x, y, z], side));
          markSight(grid, from, flat([x, y, z]));
        },
        stride,
      );
    }
    this.grid = grid;
    this.landmarks = this.all().filter((p) => !filled.has(voxelOf(p, side)));
  }

  /** Draws below the marks of the picture. */
  draw(context: CanvasRenderingContext2D, project: Project, isPlan: boolean): void {
    if (isPlan && this.grid) this.hatch(context, project, this.grid);
    context.fillStyle = "#9fb4c4";
    for (const landmark of this.landmarks) {
      const at = project(landmark);
      if (at) context.fillRect(at[0] - 1, at[1] - 1, 2, 2);
    }
  }

  private hatch(context: CanvasRenderingContext2D, project: Project, grid: PlanGrid): void {
    const [a, b] = this.cloud.basis;
    const corner = (column: number, row: number): [number, number] | null =>
      project(add(times(a, grid.low[0] + column * grid.cell), times(b, grid.low[1] + row * grid.cell)));
    const [from, to] = [corner(0, 0), corner(grid.columns, grid.rows)];
    if (!from || !to) return;
    const [wide, high] = [(to[0] - from[0]) / grid.columns, (to[1] - from[1]) / grid.rows];
    const cells = new Path2D();
    for (const [row, first, count] of unseenRuns(grid)) {
      cells.rect(from[0] + first * wide, from[1] + row * high, count * wide, high);
    }
    context.save();
    context.clip(cells);
    context.strokeStyle = "rgba(255, 157, 0, 0.45)";
    context.lineWidth = 1.5;
    context.beginPath();
    const [top, bottom] = [Math.min(from[1], to[1]), Math.max(from[1], to[1])];
    for (let x = Math.min(from[0], to[0]) - (bottom - top); x < Math.max(from[0], to[0]); x += 9) {
      context.moveTo(x, bottom);
      context.lineTo(x + bottom - top, top);
    }
    context.stroke();
    context.restore();
  }
}
