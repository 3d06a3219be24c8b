// SPDX-License-Identifier: BSD-2-Clause
// What buttons and keys are called.
import { type Kind, type Result, measureText } from "./measure";
import type { Coloring, Mode } from "./state";

export const modeWords: Record<Mode, string> = { orbit: "Around", plan: "Plan", walk: "Flight", keyframe: "Photo" };
export const coloringWords: Record<Coloring, string> = {
  photo: "Photo colours",
  height: "Height",
  confidence: "Confidence",
  views: "Views",
  normal: "Normals",
};
export const kindWords: Record<Kind, string> = { distance: "Distance", height: "Height", angle: "Angle", area: "Area" };
/** What a measurement says, with its parts. */
export function measureWords({ text, parts }: Result, unit: string): string {
  if (!parts) return text;
  const part = ({ value, error }: { value: number; error: number }): string => measureText("distance", value, error, unit);
  return `${text}; horizontal ${part(parts.horizontal)}, vertical ${part(parts.vertical)}`;
}

export const keyWords: [string, string][] = [
  ["1 2 3 4", "around, plan, flight, photo"],
  ["C", "next colouring"],
  ["Arrow keys", "turn or move"],
  ["+ and -", "nearer, farther"],
  ["N and B", "next and previous keyframe"],
  ["F and G", "towards the photo, towards the points"],
  ["W A S D", "walk; in a photo to the next keyframe that way"],
  ["E and Q", "up and down"],
  ["L, H, V, R", "measure a distance, a height, an angle, an area"],
  ["K", "set the scale by a known length"],
  ["Enter", "take the point in the middle of the picture; again there, or after a click: end an area"],
  ["Shift", "with a click or Enter: without snapping"],
  ["T", "snapping on or off"],
  ["U or Ctrl+Z", "undo"],
  ["X", "clear measurements and notes"],
  ["Y or Ctrl+C", "copy measurements and notes"],
  ["M", "metres or feet"],
  ["P", "the photo that sees the last point best"],
  ["Escape", "stop measuring"],
  ["O", "save a picture"],
  ["0", "start again"],
];
