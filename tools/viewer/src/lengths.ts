// SPDX-License-Identifier: BSD-2-Clause
// Unit of lengths: that of the cloud, or metres by a known length; in feet where wanted.
import { type About, type Picked, type Scale, resultOf, unscaled } from "./measure";
import type { Vec3 } from "./geometry";

export const units = ["m", "ft"] as const;
export type Unit = (typeof units)[number];

const metresOf: Record<Unit, number> = { m: 1, ft: 0.3048 };

/** A distance of which the length is known. */
export interface Calibration {
  points: [Picked, Picked];
  metres: number;
  /** Half of the last digit that was given [m]. */
  rounding: number;
}

/** "2.01", "2,01 m", "6.6 ft", "6' 7\\"": metres, and half of the last digit; null where it is no length > 0. `otherwise`: without a unit. */
export function lengthFrom(text: string, otherwise: Unit): { metres: number; rounding: number } | null {
  const plain = text.trim().replaceAll(",", ".");
  const whole = /^(\d{1,6}(?:\.(\d{1,6}))?)\s*(m|ft|'|)$/i.exec(plain);
  if (whole) {
    const one = metresOf[whole[3] === "" ? otherwise : whole[3]?.toLowerCase() === "m" ? "m" : "ft"];
    const metres = Number(whole[1]) * one;
    return metres > 0 ? { metres, rounding: 0.5 * one * 10 ** -(whole[2]?.length ?? 0) } : null;
  }
  const inches = /^(\d{1,6})\s*(?:'|ft)\s*(\d{1,2}(?:\.(\d{1,6}))?)\s*(?:"|''|in)$/i.exec(plain);
  if (!inches) return null;
  const inch = metresOf.ft / 12;
  const metres = Number(inches[1]) * metresOf.ft + Number(inches[2]) * inch;
  return metres > 0 ? { metres, rounding: 0.5 * inch * 10 ** -(inches[3]?.length ?? 0) } : null;
}

/** Metres per unit of the page, and their relative error [95 %]; null = the scale is unknown. */
function metresPerUnit(unit: string, calibration: Calibration | null, about: Omit<About, "scale">): { factor: number; relativeError: number } | null {
  if (calibration) {
    const { value, error } = resultOf({ kind: "distance", points: calibration.points }, { ...about, scale: unscaled("") });
    return { factor: calibration.metres / value, relativeError: Math.hypot(error / value, calibration.rounding / calibration.metres) };
  }
  const known = units.find((it) => it === unit);
  return known ? { factor: metresOf[known], relativeError: 0 } : null;
}

/** `unit`: of the page; `wanted`: null = as the page, or metres by a known length. */
export function scaleOf(unit: string, calibration: Calibration | null, wanted: Unit | null, about: Omit<About, "scale">): Scale {
  const metres = metresPerUnit(unit, calibration, about);
  if (!metres || (!calibration && (wanted ?? unit) === unit)) return unscaled(unit);
  const shown = wanted ?? "m";
  return { unit: shown, factor: metres.factor / metresOf[shown], relativeError: metres.relativeError };
}

/** Whether lengths can be shown in metres and feet. */
export const hasUnits = (unit: string, calibration: Calibration | null): boolean => calibration !== null || units.some((it) => it === unit);

/** For a shell: a word that means itself. */
const quoted = (word: string): string => (/^[\w./-]+$/.test(word) && !word.startsWith("-") ? word : `'${word.replaceAll("'", "'\\''").replace(/^-/, "./-")}'`);

/** The command that writes the cloud in metres, from places as the address keeps them. `origin`: of the page, in the frame of the cloud. */
export function convertCommand(cloud: string, calibration: Calibration, origin: Vec3): string {
  const point = ({ position }: Picked): string => position.map((x, i) => String(Number((Number(x.toPrecision(6)) + origin[i as 0]).toPrecision(12)))).join(",");
  const [from, to] = calibration.points;
  const name = cloud.replaceAll(/[\u0000-\u001f\u007f]/g, "?");
  return `pmsp-densify convert ${quoted(name)} -o metres.ply --length ${point(from)} ${point(to)} ${Number(calibration.metres.toPrecision(9))}`;
}
