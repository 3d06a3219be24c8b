// SPDX-License-Identifier: BSD-2-Clause
// Buttons that measure, the points that are taken for them, and undoing.
import { button, el } from "./dom";
import { type Vec3, norm, sub } from "./geometry";
import { lengthFrom, units } from "./lengths";
import { type Kind, type Picked, pointsOf } from "./measure";
import { Picking } from "./picking";
import { type ViewState, kMaxLetters, kMaxMarks } from "./state";
import type { Viewer } from "./viewer";
import { kindWords, measureWords } from "./words";

type Tool = Kind | "note" | "length";
type Kept = Pick<ViewState, "measurements" | "notes" | "calibration">;

const instructions: Record<Tool, string> = {
  distance: "Click two points.",
  height: "Click two points; what counts is how much higher one is.",
  angle: "Click three points; the angle is at the second one.",
  area: "Click the corners, then Area again or Enter.",
  length: "Click two points whose distance is known.",
  note: "Click what the note is about.",
};

/** A second click so near to the first is one click [px]. */
const kSameClick = 3;
const kMostUndone = 100;

export class Measuring {
  readonly buttons = el("div", { role: "group", "aria-label": "Measure" });
  readonly picking: Picking;
  private readonly toolButtons = new Map<Tool, HTMLButtonElement>();
  private tool: Tool | null = null;
  private readonly undone: Kept[] = [];
  /** For a photo, the last one. */
  private request: object = {};
  private lastClick: { x: number; y: number; view: string } | null = null;
  /** View in which Enter took the last point; null = it was clicked. */
  private entered: string | null = null;

  /** `changed`: there is another measurement or note, or another tool is chosen. */
  constructor(
    private readonly viewer: Viewer,
    private readonly state: ViewState,
    private readonly say: (text: string) => void,
    private readonly changed: () => void,
    private readonly openPhoto: (which: number, direction: Vec3) => void,
  ) {
    this.picking = new Picking(viewer);
    for (const tool of Object.keys(instructions) as Tool[]) {
      const made = button(tool === "note" ? "Note" : tool === "length" ? "Known length" : kindWords[tool], () => this.choose(tool));
      this.toolButtons.set(tool, made);
      this.buttons.append(made);
    }
  }

  /** null = a click takes no point. */
  get chosen(): Tool | null {
    return this.tool;
  }

  /** Again the same: ends it, and completes an area. */
  choose(tool: Tool | null): void {
    if (tool === "area" && this.canComplete) {
      this.complete("area");
      return;
    }
    this.tool = tool === this.tool ? null : tool;
    this.viewer.pending = [];
    this.lastClick = null;
    this.say(this.tool ? instructions[this.tool] : "");
    this.changed();
  }

  private get canComplete(): boolean {
    return this.tool === "area" && this.viewer.pending.length >= 3;
  }

  /** Why no point can be taken, as the address keeps no more; "" = one can. */
  private get limit(): string {
    if (this.viewer.pending.length >= kMaxMarks) return `An area has at most ${kMaxMarks} corners; complete it with Area.`;
    const kind = this.tool === "note" ? "notes" : "measurements";
    const isFull = this.tool !== "length" && this.state[kind].length >= kMaxMarks;
    return isFull ? `There are at most ${kMaxMarks} ${kind}; remove one first.` : "";
  }

  private get view(): string {
    return JSON.stringify([this.state.mode, this.state.eye, this.state.target]);
  }

  /** Key Enter: takes the point in the middle, or completes an area where it has just done that. `plain`: without snapping. */
  enter(plain: boolean): void {
    const { canvas, pending } = this.viewer;
    const count = pending.length;
    if (this.canComplete && (this.entered ?? this.view) === this.view) return this.complete("area");
    this.take(canvas.clientWidth / 2, canvas.clientHeight / 2, plain);
    if (pending.length > count) this.entered = this.view;
  }

  /** Takes the point at pixels from the upper left corner of the picture. */
  take(x: number, y: number, plain: boolean): void {
    const { tool, viewer, state } = this;
    if (!tool || this.isSameClick(x, y)) return;
    if (this.limit !== "") return this.say(this.limit);
    const point = this.picking.at(x, y, this.picking.snaps && !plain);
    if (typeof point === "string") return this.say(point);
    const { picked, snap } = point;
    if (viewer.pending.some((it) => norm(sub(it.position, picked.position)) === 0)) return this.say("This point is taken already.");
    if (tool === "note") {
      const text = window.prompt("Note", "")?.slice(0, kMaxLetters);
      if (text) this.change(() => state.notes.push({ position: picked.position, text }));
      return this.choose(null);
    }
    viewer.pending.push(picked);
    this.entered = null;
    const count = viewer.pending.length;
    this.say(`${count} ${count === 1 ? "point" : "points"} taken${snap ? `, the last one on ${snap === "edge" ? "an" : "a"} ${snap}` : ""}.`);
    if (tool === "length") {
      if (count === 2) this.calibrate(viewer.pending as [Picked, Picked]);
    } else if (tool !== "area" && count === pointsOf[tool]) {
      this.complete(tool);
    }
    viewer.drawOver();
    this.changed();
  }

  private isSameClick(x: number, y: number): boolean {
    const { view } = this;
    const last = this.lastClick;
    this.lastClick = { x, y, view };
    return last !== null && last.view === view && Math.hypot(last.x - x, last.y - y) < kSameClick && this.viewer.pending.length > 0;
  }

  private complete(kind: Kind): void {
    const made = { kind, points: this.viewer.pending };
    this.viewer.pending = [];
    this.lastClick = null;
    this.change(() => this.state.measurements.push(made));
    this.say(`${kindWords[kind]}: ${measureWords(this.viewer.result(made), this.viewer.scale.unit)}`);
  }

  private calibrate(points: [Picked, Picked]): void {
    const text = window.prompt("Length between the two points, such as 2.01, 2.01 m, 6.6 ft or 6' 7\"", "");
    const length = text === null ? null : lengthFrom(text, this.state.unit ?? units.find((it) => it === this.viewer.scale.unit) ?? "m");
    this.choose(null);
    if (length) this.change(() => (this.state.calibration = { points, ...length }));
    if (text !== null) this.say(length ? "All lengths are scaled by the known one." : `"${text.slice(0, 40)}" is no length; expected one such as 2.01 m, 6.6 ft or 6' 7".`);
  }

  private kept(): Kept {
    const { measurements, notes, calibration } = this.state;
    return structuredClone({ measurements, notes, calibration });
  }

  /** Changes measurements and notes so that it can be undone. */
  change(act: () => void): void {
    this.undone.push(this.kept());
    if (this.undone.length > kMostUndone) this.undone.shift();
    act();
    this.changed();
  }

  /** The last point of an incomplete measurement, or else the last change. */
  undo(): void {
    const { pending } = this.viewer;
    this.lastClick = null;
    if (pending.pop()) {
      this.say(`The last point is undone; ${pending.length} left.`);
    } else {
      const before = this.undone.pop();
      if (before) Object.assign(this.state, before);
      this.say(before ? "The last change is undone." : "There is nothing to undo.");
    }
    this.changed();
  }

  /** Removes all measurements and notes. */
  clear(): void {
    this.viewer.pending = [];
    if (this.state.measurements.length + this.state.notes.length === 0 && !this.state.calibration) return;
    this.change(() => Object.assign(this.state, { measurements: [], notes: [], calibration: null }));
    this.say("Measurements and notes are cleared; Undo brings them back.");
  }

  toggleSnapping(): void {
    this.picking.snaps = !this.picking.snaps;
    this.say(this.picking.snaps ? "Points snap to planes, edges and corners." : "Points do not snap.");
    this.changed();
  }

  /** Opens the photo that sees a place best. Default: the last point. */
  async showBestPhoto(place: Vec3 | undefined = this.lastPoint): Promise<void> {
    if (!place) return this.say("Take a point first.");
    this.say("Looking for the photo…");
    const request = (this.request = {});
    const which = await this.picking.bestPhoto(place);
    if (this.request !== request) return; // another one is wanted meanwhile
    const keyframe = which === null ? undefined : this.viewer.data.keyframes[which];
    if (which === null || !keyframe) return this.say("No photo of this page sees that point.");
    this.openPhoto(which, sub(place, this.viewer.trajectory.centerOf(keyframe)));
    this.say(`Keyframe ${keyframe.id} sees the point best.`);
  }

  private get lastPoint(): Vec3 | undefined {
    return (this.viewer.pending.at(-1) ?? this.state.measurements.at(-1)?.points.at(-1) ?? this.state.notes.at(-1))?.position;
  }

  refresh(): void {
    this.picking.prepare();
    for (const [tool, made] of this.toolButtons) made.setAttribute("aria-pressed", String(tool === this.tool));
  }
}
