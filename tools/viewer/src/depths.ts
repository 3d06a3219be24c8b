// SPDX-License-Identifier: BSD-2-Clause
// Depth maps of keyframes; tools/pmsp-densify/report/page_depth.h has their layout.
import { unzlibSync } from "fflate";
import { type Vec3, panoramaPlace, times } from "./geometry";

const kCodesPerUnit = 1024;
const kHeaderBytes = 16;
const kMostPixels = 2 ** 20;

export class Depths {
  /** Angle of a pixel [rad]. */
  readonly pixel: number;
  readonly width: number;
  readonly height: number;
  private readonly depths: Float32Array;
  private readonly confidences: Uint8Array;

  /** `bytes`: as stored. Throws where they are not a depth map. */
  constructor(bytes: Uint8Array) {
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    const header = bytes.length > kHeaderBytes ? [view.getUint32(0, true), view.getUint32(4, true), view.getFloat64(8, true)] : [];
    const [width = 0, height = 0, least = 0] = header;
    const count = width * height;
    if (!(count > 0 && count <= kMostPixels && least > 0)) throw new Error("a depth map is damaged");
    const planes = unzlibSync(bytes.subarray(kHeaderBytes), { out: new Uint8Array(3 * count) });
    if (planes.length !== 3 * count) throw new Error("a depth map is damaged");
    [this.width, this.height] = [width, height];
    this.pixel = (2 * Math.PI) / width;
    this.depths = new Float32Array(count);
    this.confidences = planes.subarray(2 * count);
    let code = 0;
    for (let i = 0; i < count; ++i) {
      if (this.confidences[i] === 0) continue;
      const folded = planes[i]! + 256 * planes[count + i]!;
      code += folded % 2 === 0 ? folded / 2 : -(folded + 1) / 2;
      this.depths[i] = least * Math.exp(code / kCodesPerUnit);
    }
  }

  private index(column: number, row: number): number {
    const across = ((column % this.width) + this.width) % this.width;
    return row < 0 || row >= this.height ? -1 : row * this.width + across;
  }

  /** Along the ray through a pixel's centre; 0 = none. Columns wrap around. */
  at(column: number, row: number): number {
    return this.depths[this.index(column, row)] ?? 0;
  }

  confidenceAt(column: number, row: number): number {
    return ((this.confidences[this.index(column, row)] ?? 0) / 15) ** 2;
  }

  /** Column and row of a direction in the camera's axes; an integer is a pixel's upper left corner. */
  placeOf(direction: Vec3): [number, number] {
    const [across, down] = panoramaPlace(direction);
    return [across * this.width, down * this.height];
  }

  /** Ray through a pixel's centre, in the camera's axes. */
  rayOf(column: number, row: number): Vec3 {
    const longitude = ((column + 0.5) / this.width - 0.5) * 2 * Math.PI;
    const latitude = (0.5 - (row + 0.5) / this.height) * Math.PI;
    return [Math.cos(latitude) * Math.sin(longitude), -Math.sin(latitude), Math.cos(latitude) * Math.cos(longitude)];
  }

  /** Pixels within `radius` pixels of a place, which near the poles are many columns. */
  around(column: number, row: number, radius: number, visit: (column: number, row: number) => void): void {
    for (let y = Math.floor(row - radius); y <= row + radius; ++y) {
      if (y < 0 || y >= this.height) continue;
      const down = y + 0.5 - row;
      const room = radius * radius - down * down;
      if (room < 0) continue;
      const shrink = Math.max(Math.cos((0.5 - (y + 0.5) / this.height) * Math.PI), 1e-3);
      const reach = Math.min(Math.sqrt(room) / shrink, this.width / 2 - 1);
      for (let x = Math.ceil(column - reach - 0.5); x + 0.5 <= column + reach; ++x) visit(x, y);
    }
  }
}

/** Where a ray in the camera's axes begins: rays of two lenses do so in front of the centre and behind it. */
const lensOf = (ray: Vec3, lensDistance: number): Vec3 => [0, 0, (ray[2] > 0 ? 0.5 : -0.5) * lensDistance];

/** Place of a depth along a ray, in the camera's axes. */
export function placeAt(ray: Vec3, depth: number, lensDistance: number): Vec3 {
  const along = times(ray, depth);
  return lensDistance === 0 ? along : [along[0], along[1], along[2] + lensOf(ray, lensDistance)[2]];
}
