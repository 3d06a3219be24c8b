// SPDX-License-Identifier: BSD-2-Clause
// What the colours of the points mean, in a corner of the picture.
import { type Cloud, paletteOf } from "./cloud";
import { el } from "./dom";
import type { Scale } from "./measure";
import { cssGradient } from "./palette";
import type { Coloring } from "./state";

export function showLegend(place: HTMLElement, coloring: Coloring, cloud: Cloud, { unit, factor }: Scale): void {
  const palette = paletteOf(coloring);
  const height = factor * (cloud.high[2] - cloud.low[2]);
  const ends: Partial<Record<Coloring, [string, string]>> = {
    height: ["0", `${Number(height.toPrecision(3))} ${unit}`],
    confidence: ["0: unsure", "1: sure"],
    views: ["1 view", "10 and more"],
  };
  const [from, to] = ends[coloring] ?? ["", ""];
  place.hidden = palette === null;
  const bar = el("span", { class: "gradient", "aria-hidden": "true" });
  if (palette) bar.style.background = cssGradient(palette);
  place.replaceChildren(el("span", {}, from), bar, el("span", {}, to));
}
