// SPDX-License-Identifier: BSD-2-Clause
// Palettes that people with any colour vision can read: lightness grows all the way.

const stops = {
  viridis: "440154 482878 3e4989 31688e 26828e 1f9e89 35b779 6ece58 b5de2b fde725",
  cividis: "00224e 123570 3b496c 575d6d 707173 8a8678 a59c74 c3b369 e1cc55 fee838",
};
export type PaletteName = keyof typeof stops;

/** Red, green, blue, 0 to 255; `share` from 0 to 1. */
export function colorAt(name: PaletteName, share: number): [number, number, number] {
  const list = stops[name].split(" ").map((hex) => Number.parseInt(hex, 16));
  const at = Math.max(0, Math.min(1, share)) * (list.length - 1);
  const first = Math.min(Math.floor(at), list.length - 2);
  const t = at - first;
  const mix = (shift: number): number => {
    const low = ((list[first] ?? 0) >> shift) & 255;
    const high = ((list[first + 1] ?? 0) >> shift) & 255;
    return Math.round(low + t * (high - low));
  };
  return [mix(16), mix(8), mix(0)];
}

/** 256 colours, RGBA. */
export function paletteBytes(name: PaletteName): Uint8Array<ArrayBuffer> {
  const bytes = new Uint8Array(1024);
  for (let i = 0; i < 256; ++i) bytes.set([...colorAt(name, i / 255), 255], 4 * i);
  return bytes;
}

export const cssColor = (name: PaletteName, share: number): string => `rgb(${colorAt(name, share).join(" ")})`;

/** A bar of the palette, dark end on the left. */
export const cssGradient = (name: PaletteName): string =>
  `linear-gradient(to right, ${stops[name]
    .split(" ")
    .map((hex) => `#${hex}`)
    .join(", ")})`;
