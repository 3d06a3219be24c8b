// SPDX-License-Identifier: BSD-2-Clause
// Reads the true ranges that pmsp-synth writes: gray PNG of 16 bits, without interlacing.
import { readFileSync } from "node:fs";
import { inflateSync } from "node:zlib";

export interface RangeMap {
  width: number;
  height: number;
  /** Along the ray through a pixel's centre [m]; 0 = nothing. Columns wrap around, rows end. */
  at: (column: number, row: number) => number;
}

export function readRangeMap(path: string): RangeMap {
  const file = readFileSync(path);
  const [width, height] = [file.readUInt32BE(16), file.readUInt32BE(20)];
  if (file[24] !== 16 || file[25] !== 0 || file[28] !== 0) throw new Error(`${path}: expected a gray PNG of 16 bits`);
  const parts: Buffer[] = [];
  for (let at = 8; at + 8 < file.length; at += 12 + file.readUInt32BE(at)) {
    if (file.toString("latin1", at + 4, at + 8) === "IDAT") parts.push(file.subarray(at + 8, at + 8 + file.readUInt32BE(at)));
  }
  const packed = inflateSync(Buffer.concat(parts));
  const line = 2 * width;
  const bytes = Buffer.alloc(line * height);
  for (let row = 0; row < height; ++row) {
    const filter = packed[row * (line + 1)];
    for (let x = 0; x < line; ++x) {
      const here = row * line + x;
      const left = x >= 2 ? bytes[here - 2]! : 0;
      const above = row > 0 ? bytes[here - line]! : 0;
      const corner = x >= 2 && row > 0 ? bytes[here - line - 2]! : 0;
      const [a, b, c] = [Math.abs(above - corner), Math.abs(left - corner), Math.abs(left + above - 2 * corner)];
      const paeth = a <= b && a <= c ? left : b <= c ? above : corner;
      const guess = [0, left, above, (left + above) >> 1, paeth][filter ?? 0] ?? 0;
      bytes[here] = (packed[row * (line + 1) + 1 + x]! + guess) & 255;
    }
  }
  const at = (column: number, row: number): number => {
    const wrapped = ((column % width) + width) % width;
    return bytes.readUInt16BE(2 * (wrapped + width * Math.max(0, Math.min(height - 1, row)))) / 1000;
  };
  return { width, height, at };
}
