// SPDX-License-Identifier: BSD-2-Clause
// Measurements and notes as marks over the points.
import { type Vec3, add, dot, sub, times } from "./geometry";
import type { Picked } from "./measure";
import type { Mark } from "./overlay";
import type { Measurement, ViewState } from "./state";

/** A height stands upright over its lower point; a level line leads to the upper one. */
function upright(points: readonly Vec3[], up: Vec3): Vec3[] {
  const [a, b] = points;
  if (!a || !b) return [...points];
  const rise = dot(sub(b, a), up);
  const [low, high] = rise < 0 ? [b, a] : [a, b];
  return [low, add(low, times(up, Math.abs(rise))), high];
}

/** `pending`: points of a measurement that is not complete. `text`: what a measurement says. */
export function marksOf(state: ViewState, pending: readonly Picked[], up: Vec3, text: (it: Measurement) => string): Mark[] {
  const marks: Mark[] = state.measurements.map((it) => {
    const dots = it.points.map((p) => p.position);
    return { points: it.kind === "height" ? upright(dots, up) : dots, dots, closed: it.kind === "area", text: it.name ? `${it.name}: ${text(it)}` : text(it) };
  });
  const known = state.calibration?.points.map((p) => p.position);
  if (known) marks.push({ points: known, dots: known, closed: false, text: "known length" });
  const taken = pending.map((p) => p.position);
  if (taken.length > 0) marks.push({ points: taken, dots: taken, closed: false, text: "" });
  for (const { position, text } of state.notes) marks.push({ points: [position], dots: [position], closed: false, text });
  return marks;
}
