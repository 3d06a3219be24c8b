// SPDX-License-Identifier: BSD-2-Clause
// The picture that is printed: plans to scale.
import type { Viewer } from "./viewer";

const kPixels = 6; // per millimetre
/** Sides of the plan, in those of the cloud. */
const kMargin = 1.06;

/** A plan on paper: 1 : `scale`, in millimetres. */
interface PaperSize {
  scale: number;
  width: number;
  height: number;
}

const kPaper = [185, 235] as const; // of A4 within margins, below a title [mm]

/** 1 : 100 for sides in metres, or the largest of the usual smaller scales with which they fit onto a page. */
export function paperSize(wide: number, deep: number): PaperSize {
  const least = Math.max((1000 * wide) / kPaper[0], (1000 * deep) / kPaper[1], 100);
  const power = 10 ** Math.floor(Math.log10(least));
  const scale = [1, 2, 5].map((it) => it * power).find((it) => it >= least) ?? 10 * power;
  return { scale, width: (1000 * wide) / scale, height: (1000 * deep) / scale };
}

/** With a known scale a plan to scale, `width` mm wide; else the picture as it is, of no width. */
export function printed(viewer: Viewer): { picture: HTMLCanvasElement; width: number | null } {
  const { low, high } = viewer.cloud;
  const { unit, factor } = viewer.scale;
  const metres = unit === "m" ? factor : unit === "ft" ? 0.3048 * factor : 0;
  if (viewer.state.mode !== "plan" || metres === 0) return { picture: viewer.picture(), width: null };
  const side = (axis: 0 | 1): number => metres * kMargin * (high[axis] - low[axis]);
  const { scale, width, height } = paperSize(side(0), side(1));
  return { picture: viewer.planPicture(Math.round(kPixels * width), Math.round(kPixels * height), scale, 1 / kMargin), width };
}
