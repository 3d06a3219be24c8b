// SPDX-License-Identifier: BSD-2-Clause
// Storeys of a building, from heights of surfaces and cameras.

export interface Storey {
  /** Heights [unit]. */
  floor: number;
  /** Of the next floor; null = the uppermost storey. */
  top: number | null;
  /** Median of its cameras. */
  camera: number;
  /** Nine tenths of its cameras are not above. */
  highestCamera: number;
}

const kBins = 400;
/** Of the largest floor's area, the least of a floor. */
const kLeastArea = 0.3;
/** Height of a storey, the least, in heights of cameras above their floor. */
const kLeastHeight = 1.25;
/** Half of the stretch of heights that counts as one floor [bins]. */
const kReach = 2;

/**
 * Returns the storeys with cameras in them, from below. `floors`: heights of surfaces that face up; `cameras`: not
 * empty. `low` and `high`: of the building. Without floors there is one storey.
 */
export function storeysOf(floors: readonly number[], cameras: readonly number[], low: number, high: number): Storey[] {
  const storey = (floor: number, heights: readonly number[]): Storey => {
    const sorted = [...heights].sort((a, b) => a - b);
    const at = (share: number): number => sorted[Math.floor(share * (sorted.length - 1))] ?? (low + high) / 2;
    return { floor, top: null, camera: at(0.5), highestCamera: at(0.9) };
  };
  const one = [storey(low, cameras)];
  const counts = new Array<number>(kBins).fill(0);
  const bin = (high - low) / kBins;
  if (!(bin > 0) || cameras.length === 0) return one;
  for (const height of floors) {
    const at = Math.floor((height - low) / bin);
    if (at >= 0 && at < kBins) counts[at]! += 1;
  }
  const around = (i: number, reach: number): number[] => counts.slice(Math.max(0, i - reach), i + reach + 1);
  const area = counts.map((_, i) => around(i, kReach).reduce((sum, n) => sum + n, 0));
  const most = Math.max(...area);
  const peaks: number[] = [];
  area.forEach((n, i) => {
    const near = area.slice(Math.max(0, i - 4 * kReach), i + 4 * kReach + 1);
    const first = Math.max(0, i - kReach);
    const height = low + (first + 0.5 + around(i, kReach).reduce((sum, count, k) => sum + k * count, 0) / n) * bin;
    if (n === 0 || n < kLeastArea * most || n < Math.max(...near) || height - (peaks.at(-1) ?? -Infinity) < 4 * kReach * bin) return;
    peaks.push(height);
  });
  // Cameras belong to the highest floor below them; a large table or shelf is no floor, since few cameras are above it
  // alone: floors that are close to each other, compared with the height of cameras, are one.
  const groups = new Map<number, number[]>();
  for (const camera of cameras) {
    const below = peaks.filter((floor) => floor < camera);
    const floor = below.at(-1) ?? low;
    groups.set(floor, [...(groups.get(floor) ?? []), camera]);
  }
  const found = [...groups].map(([floor, heights]) => storey(floor, heights)).sort((a, b) => a.floor - b.floor);
  const eye = Math.max(...found.map((it) => it.camera - it.floor));
  const kept: Storey[] = [];
  for (const it of found) {
    const below = kept.at(-1);
    if (below && it.floor - below.floor < kLeastHeight * eye) continue;
    if (below) below.top = it.floor;
    kept.push(it);
  }
  return kept.length > 0 ? kept : one;
}
