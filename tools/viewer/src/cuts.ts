// SPDX-License-Identifier: BSD-2-Clause
// What of the cloud is shown: low and high along each axis of the page, null = no limit.
import type { Vec3 } from "./geometry";
import type { Storey } from "./storeys";

export type Cut = (number | null)[];

export const noCut = (): Cut => [null, null, null, null, null, null];

export const isSameCut = (a: Cut, b: Cut): boolean => a.every((x, i) => x === b[i] || Math.abs((x ?? NaN) - (b[i] ?? NaN)) < 1e-5 * Math.abs(x ?? 0));

/** `shares`: of the stretch from `low` to `high` along each axis; 0 and 1 are no limit. */
export const cutFromShares = (shares: readonly number[], low: Vec3, high: Vec3): Cut =>
  shares.map((share, i) => {
    const axis = Math.floor(i / 2) as 0 | 1 | 2;
    return share === i % 2 ? null : low[axis] + share * (high[axis] - low[axis]);
  });

/** A storey from below its floor to a little above the cameras: its ceiling would hide it. `isLowest`: without a lower limit. */
export function planCut(storey: Storey, isLowest: boolean): Cut {
  const height = Math.max(storey.highestCamera - storey.floor, 0);
  return [null, null, null, null, isLowest ? null : storey.floor - 0.15 * height, storey.highestCamera + 0.15 * height];
}

/** A whole storey. */
export const storeyCut = (storey: Storey, isLowest: boolean): Cut => {
  const margin = 0.1 * Math.max(storey.camera - storey.floor, 0);
  return [null, null, null, null, isLowest ? null : storey.floor - margin, storey.top === null ? null : storey.top - margin];
};

/** A horizontal slice. */
export const sliceCut = (height: number, thickness: number): Cut => [null, null, null, null, height - thickness / 2, height + thickness / 2];
