// SPDX-License-Identifier: BSD-2-Clause
// Buttons that measure, and the points that are taken for them.
import { button, el } from "./dom";
import { type Kind, pointsOf } from "./measure";
import type { ViewState } from "./state";
import type { Viewer } from "./viewer";
import { kindWords } from "./words";

type Chosen = Kind | "note" | null;

const instructions: Record<Kind | "note", string> = {
  distance: "Click two points.",
  height: "Click two points; what counts is how much higher one is.",
  angle: "Click three points; the angle is at the second one.",
  area: "Click the corners, then Area again or Enter.",
  note: "Click what the note is about.",
};

export class Measuring {
  readonly buttons = el("div", { role: "group", "aria-label": "Measure" });
  private readonly kindButtons = new Map<Chosen, HTMLButtonElement>();
  private kind: Chosen = null;

  /** `changed`: there is another measurement or note, or another kind is chosen. */
  constructor(
    private readonly viewer: Viewer,
    private readonly state: ViewState,
    private readonly say: (text: string) => void,
    private readonly changed: () => void,
  ) {
    const add = (kind: Kind | "note", words: string): void => {
      const made = button(words, () => this.choose(kind));
      this.kindButtons.set(kind, made);
      this.buttons.append(made);
    };
    for (const kind of Object.keys(kindWords) as Kind[]) add(kind, kindWords[kind]);
    add("note", "Note");
  }

  /** null = a click takes no point. */
  get chosen(): Chosen {
    return this.kind;
  }

  /** Again the same: ends it, and completes an area. */
  choose(kind: Chosen): void {
    if (kind === "area" && this.canComplete) {
      this.complete("area");
      return;
    }
    this.kind = kind === this.kind ? null : kind;
    this.viewer.pending = [];
    this.say(this.kind ? instructions[this.kind] : "");
    this.changed();
  }

  private get canComplete(): boolean {
    return this.kind === "area" && this.viewer.pending.length >= 3;
  }

  /** Key Enter. */
  enter(): void {
    const { canvas } = this.viewer;
    if (this.canComplete) this.complete("area");
    else this.take(canvas.clientWidth / 2, canvas.clientHeight / 2);
  }

  /** Takes the point at pixels from the upper left corner of the picture. */
  take(x: number, y: number): void {
    const { kind, viewer } = this;
    if (!kind) return;
    const picked = viewer.pick(x, y);
    if (!picked) {
      this.say("There is no point here.");
      return;
    }
    if (kind === "note") {
      const text = window.prompt("Note", "");
      if (text) this.state.notes.push({ position: picked.position, text: text.slice(0, 200) });
      this.choose(null);
      return;
    }
    viewer.pending.push(picked);
    this.say(`${viewer.pending.length} ${viewer.pending.length === 1 ? "point" : "points"} taken.`);
    if (kind !== "area" && viewer.pending.length === pointsOf[kind]) this.complete(kind);
    viewer.redraw();
  }

  private complete(kind: Kind): void {
    const made = { kind, points: this.viewer.pending };
    this.viewer.pending = [];
    this.state.measurements.push(made);
    this.say(`${kindWords[kind]}: ${this.viewer.result(made).text}`);
    this.changed();
  }

  refresh(): void {
    for (const [kind, made] of this.kindButtons) made.setAttribute("aria-pressed", String(kind === this.kind));
  }
}
