// SPDX-License-Identifier: BSD-2-Clause
// Keys of the picture; words.ts names them for Help.
import type { Measuring } from "./measuring";
import type { Results } from "./results";
import type { Mode, ViewState } from "./state";
import type { Viewer } from "./viewer";

interface KeyTarget {
  state: ViewState;
  viewer: Viewer;
  measuring: Measuring;
  results: Results;
  setMode: (mode: Mode) => void;
  nextColoring: () => void;
  fadeBy: (by: number) => void;
  save: () => void;
}

/** Right, up, closer. */
const nudges: Record<string, [number, number, number]> = {
  ArrowLeft: [-1, 0, 0],
  ArrowRight: [1, 0, 0],
  ArrowUp: [0, 1, 0],
  ArrowDown: [0, -1, 0],
  "+": [0, 0, 1],
  "-": [0, 0, -1],
};

const acts: Record<string, (page: KeyTarget, event: KeyboardEvent) => void> = {
  "1": (page) => page.setMode("orbit"),
  "2": (page) => page.setMode("plan"),
  "3": (page) => page.setMode("walk"),
  "4": (page) => page.setMode("keyframe"),
  c: (page) => page.nextColoring(),
  n: ({ viewer }) => viewer.tour.step(1),
  b: ({ viewer }) => viewer.tour.step(-1),
  f: (page) => page.fadeBy(-0.1),
  g: (page) => page.fadeBy(0.1),
  l: ({ measuring }) => measuring.choose("distance"),
  h: ({ measuring }) => measuring.choose("height"),
  v: ({ measuring }) => measuring.choose("angle"),
  r: ({ measuring }) => measuring.choose("area"),
  k: ({ measuring }) => measuring.choose("length"),
  t: ({ measuring }) => measuring.toggleSnapping(),
  u: ({ measuring }) => measuring.undo(),
  x: ({ measuring }) => measuring.clear(),
  y: ({ results }) => results.copy(),
  m: ({ results }) => results.nextUnit(),
  p: ({ measuring }) => measuring.showBestPhoto(),
  o: (page) => page.save(),
  "0": (page) => page.setMode(page.state.mode),
  Escape: ({ measuring }) => measuring.choose(null),
  Enter: ({ measuring }, { shiftKey }) => measuring.enter(shiftKey),
};

/** With Ctrl. */
const commands: Record<string, (page: KeyTarget, event: KeyboardEvent) => void> = {
  c: ({ results }) => results.copy(),
  z: ({ measuring }) => measuring.undo(),
};

export function listenForKeys(canvas: HTMLCanvasElement, page: KeyTarget): void {
  canvas.addEventListener("keydown", (event) => {
    const isCommand = event.ctrlKey || event.metaKey;
    const nudge = isCommand ? undefined : nudges[event.key];
    const act = (isCommand ? commands : acts)[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (event.altKey || (!nudge && !act)) return;
    event.preventDefault();
    if (nudge) page.viewer.nudge(...nudge);
    act?.(page, event);
  });
}
