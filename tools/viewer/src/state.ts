// SPDX-License-Identifier: BSD-2-Clause
// What is looked at, as text for the page's address. Whatever comes from there is checked.
import { type Vec3, norm, sub } from "./geometry";
import { type Calibration, type Unit, units } from "./lengths";
import { type Kind, type Picked, pointsOf } from "./measure";

export const modes = ["orbit", "plan", "walk", "keyframe"] as const;
export type Mode = (typeof modes)[number];
export const colorings = ["photo", "height", "confidence", "views", "normal"] as const;
export type Coloring = (typeof colorings)[number];

export interface Measurement {
  kind: Kind;
  points: Picked[];
  name?: string;
}
export interface Note {
  position: Vec3;
  text: string;
}

export interface ViewState {
  mode: Mode;
  coloring: Coloring;
  /** Of the eye and of what it looks at, from the page's origin; null = where the page begins. */
  eye: Vec3 | null;
  target: Vec3 | null;
  zoom: number;
  /** Index of the keyframe. */
  keyframe: number;
  /** 0 = photo, 1 = points */
  fade: number;
  /** Point size, times the usual one. */
  size: number;
  /** What is shown, low and high along each axis of the page, from the page's origin; null = no limit. */
  cut: (number | null)[];
  /** The same as shares of the cloud's extent, from old addresses; null = not given, or converted to `cut`. */
  clip: number[] | null;
  /** The axes of the page follow the path, not the walls, as old addresses with a box have them. */
  isAlongPath: boolean;
  measurements: Measurement[];
  notes: Note[];
  /** null = lengths are in the unit of the cloud. */
  calibration: Calibration | null;
  /** null = as the cloud, or metres with a calibration. */
  unit: Unit | null;
}

export const initialState = (): ViewState => ({
  mode: "orbit",
  coloring: "photo",
  eye: null,
  target: null,
  zoom: 1,
  keyframe: 0,
  fade: 0,
  size: 1,
  cut: [null, null, null, null, null, null],
  clip: null,
  isAlongPath: false,
  measurements: [],
  notes: [],
  calibration: null,
  unit: null,
});

/** The most measurements, notes, and corners of an area. */
export const kMaxMarks = 100;
export const kMaxLetters = 200;
const kNameMark = ";name:";

const short = (x: number): string => String(Number(x.toPrecision(6)));
const list = (numbers: readonly number[]): string => numbers.map(short).join(",");

const pointsText = (points: readonly Picked[]): string =>
  points.map((p) => list([...p.position, p.confidence, p.keyframe, p.spread])).join(";");

export function stateText(state: ViewState): string {
  const parts = new URLSearchParams();
  const first = initialState();
  if (state.mode !== first.mode) parts.set("view", state.mode);
  if (state.coloring !== first.coloring) parts.set("color", state.coloring);
  if (state.eye && state.target) {
    parts.set("eye", list(state.eye));
    parts.set("at", list(state.target));
  }
  if (state.zoom !== 1) parts.set("zoom", short(state.zoom));
  if (state.mode === "keyframe" || state.mode === "walk") parts.set("keyframe", String(state.keyframe));
  if (state.mode === "keyframe") parts.set("fade", short(state.fade));
  if (state.size !== 1) parts.set("size", short(state.size));
  if (state.clip) parts.set("clip", list(state.clip));
  else if (state.cut.some((x) => x !== null)) parts.set("cut", state.cut.map((x) => (x === null ? "" : short(x))).join(","));
  if (state.isAlongPath) parts.set("axes", "path");
  for (const it of state.measurements) {
    parts.append(it.kind, pointsText(it.points) + (it.name ? kNameMark + it.name : ""));
  }
  const known = state.calibration;
  if (known) parts.set("length", `${pointsText(known.points)};${list([known.metres, known.rounding])}`);
  if (state.unit) parts.set("unit", state.unit);
  for (const note of state.notes) parts.append("note", `${list(note.position)};${note.text}`);
  return parts.toString();
}

function numbers(text: string | null, count: number): number[] | null {
  if (text === null) return null;
  const values = text.split(",").map((word) => (word.trim() === "" ? Number.NaN : Number(word)));
  return values.length === count && values.every((x) => Number.isFinite(x) && Math.abs(x) < 1e12) ? values : null;
}

function vector(text: string | null): Vec3 | null {
  const found = numbers(text, 3);
  return found ? [found[0] ?? 0, found[1] ?? 0, found[2] ?? 0] : null;
}

const between = (x: number | undefined, low: number, high: number): number => Math.max(low, Math.min(high, x ?? low));

function picked(text: string): Picked | null {
  const n = numbers(text, 6);
  return n && {
    position: [n[0] ?? 0, n[1] ?? 0, n[2] ?? 0],
    confidence: between(n[3], 0, 1),
    keyframe: Math.round(between(n[4], -1, 65534)),
    spread: between(n[5], 0, 1e12),
  };
}

function measurement(kind: Kind, text: string): Measurement | null {
  const [places = "", ...name] = text.split(kNameMark);
  const points = places.split(";", kMaxMarks + 1).map(picked);
  if (points.length > kMaxMarks || !points.every((it): it is Picked => it !== null)) return null;
  if (points.length !== pointsOf[kind] && (kind !== "area" || points.length < 3)) return null;
  return name.length > 0 ? { kind, points, name: name.join(kNameMark).slice(0, kMaxLetters) } : { kind, points };
}

function calibration(text: string | null): Calibration | null {
  const words = text?.split(";") ?? [];
  const [from, to] = words.slice(0, 2).map(picked);
  const [metres = 0, rounding = 0] = numbers(words[2] ?? null, 2) ?? [];
  const isSound = words.length === 3 && metres > 0 && rounding >= 0 && rounding <= metres;
  return isSound && from && to && norm(sub(to.position, from.position)) > 0 ? { points: [from, to], metres, rounding } : null;
}

export function stateFrom(text: string): ViewState {
  const state = initialState();
  const parts = new URLSearchParams(text.replace(/^#/, ""));
  const one = <T extends string>(all: readonly T[], name: string, otherwise: T): T =>
    all.find((it) => it === parts.get(name)) ?? otherwise;
  state.mode = one(modes, "view", state.mode);
  state.coloring = one(colorings, "color", state.coloring);
  const eye = vector(parts.get("eye"));
  const target = vector(parts.get("at"));
  if (eye && target) {
    state.eye = eye;
    state.target = target;
  }
  const number = (name: string, low: number, high: number, otherwise: number): number => {
    const found = numbers(parts.get(name), 1);
    return found ? between(found[0], low, high) : otherwise;
  };
  state.zoom = number("zoom", 0.01, 1000, state.zoom);
  state.keyframe = Math.round(number("keyframe", 0, 1e6, state.keyframe));
  state.fade = number("fade", 0, 1, state.fade);
  state.size = number("size", 0.2, 5, state.size);
  const clip = numbers(parts.get("clip"), 6)?.map((x) => between(x, 0, 1));
  if (clip && list(clip) !== "0,1,0,1,0,1") state.clip = clip;
  state.isAlongPath = parts.get("axes") === "path" || (state.clip !== null && list(state.clip.slice(0, 4)) !== "0,1,0,1");
  const cut = parts.get("cut")?.split(",") ?? [];
  if (cut.length === 6) state.cut = cut.map((word) => numbers(word, 1)?.[0] ?? null);
  state.calibration = calibration(parts.get("length"));
  state.unit = units.find((it) => it === parts.get("unit")) ?? null;
  for (const [name, text] of parts) {
    const kind = (Object.keys(pointsOf) as Kind[]).find((it) => it === name);
    const found = kind && state.measurements.length < kMaxMarks ? measurement(kind, text) : null;
    if (found) state.measurements.push(found);
  }
  for (const text of parts.getAll("note").slice(0, kMaxMarks)) {
    const end = text.indexOf(";");
    const position = vector(text.slice(0, end));
    if (end > 0 && position) state.notes.push({ position, text: text.slice(end + 1).slice(0, kMaxLetters) });
  }
  return state;
}
