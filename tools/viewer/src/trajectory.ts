// SPDX-License-Identifier: BSD-2-Clause
// Keyframes along the trajectory. `order`: indices of the existing keyframes, from the first to the last.
import type { KeyframeData } from "./data";
import { hasPhoto } from "./panorama";

/** Returns those with a depth map, or all if there are none. */
export function pathOf(keyframes: readonly KeyframeData[], order: readonly number[]): number[] {
  const used = order.filter((i) => keyframes[i]?.use === "depth map");
  return used.length > 0 ? used : [...order];
}

/** Returns the nearest one along the trajectory; with `withPhoto` one with a photo, if there is any. */
export function nearestKeyframe(
  keyframes: readonly KeyframeData[],
  order: readonly number[],
  which: number,
  withPhoto: boolean,
): number {
  let able = order.filter((i) => !withPhoto || hasPhoto(keyframes[i]));
  if (able.length === 0) able = pathOf(keyframes, order);
  const rank = new Map(order.map((index, i) => [index, i]));
  const rankOf = (index: number): number => rank.get(index) ?? index;
  const distance = (index: number): number => Math.abs(rankOf(index) - rankOf(which));
  return able.reduce((best, i) => (distance(i) < distance(best) ? i : best), able[0] ?? 0);
}
