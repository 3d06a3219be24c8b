// SPDX-License-Identifier: BSD-2-Clause
// What buttons and keys are called.
import type { Kind } from "./measure";
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
export const keyWords: [string, string][] = [
  ["1 2 3 4", "around, plan, flight, photo"],
  ["C", "next colouring"],
  ["Arrow keys", "turn or move"],
  ["+ and -", "nearer, farther"],
  ["N and B", "next and previous keyframe"],
  ["F and G", "towards the photo, towards the points"],
  ["D, H, A, R", "measure a distance, a height, an angle, an area"],
  ["Enter", "take the point in the middle of the picture; end an area"],
  ["Escape", "stop measuring"],
  ["S", "save a picture"],
  ["0", "start again"],
];
