// SPDX-License-Identifier: BSD-2-Clause
// Which keyframes of a flight one can stand at.
import type { KeyframeData } from "./data";

/** Places of those that something can be seen from, in the order of flight. */
export function pathOf(keyframes: readonly KeyframeData[]): number[] {
  const all = keyframes.map((_, i) => i);
  const used = all.filter((i) => keyframes[i]?.use === "depth map");
  return used.length > 0 ? used : all;
}

/** The one nearest in the order of flight; with a photo where there is any. */
export function nearestKeyframe(keyframes: readonly KeyframeData[], which: number, withPhoto: boolean): number {
  let able = keyframes.map((_, i) => i).filter((i) => !withPhoto || keyframes[i]?.panorama);
  if (able.length === 0) able = pathOf(keyframes);
  return able.reduce((best, i) => (Math.abs(i - which) < Math.abs(best - which) ? i : best), able[0] ?? 0);
}
