// SPDX-License-Identifier: BSD-2-Clause
// Measurements and notes as files. A file has one unit of lengths, which it names; its coordinates are those of the
// cloud, in that unit.
import type { Vec3 } from "./geometry";
import { type Kind, type Valued, measureText } from "./measure";

/** A measurement, or a note. */
export interface Row extends Partial<Valued> {
  name: string;
  kind: Kind | "note";
  /** In the unit of the file. */
  points: Vec3[];
  horizontal?: Valued;
  vertical?: Valued;
}

export interface Sheet {
  /** "m", "ft", "map units" */
  unit: string;
  /** Factor from the cloud's coordinates to those of the file. */
  scale: number;
  rows: Row[];
}

const number = (x: number): string => String(Number(x.toPrecision(12)));
const place = (p: Vec3): string => p.map(number).join(" ");

/** "m", "m2", "deg"; "" for a note. */
function unitOf(kind: Row["kind"], unit: string): string {
  return kind === "note" ? "" : kind === "angle" ? "deg" : kind === "area" ? `${unit}2` : unit;
}

function wkt({ kind, points }: Row): string {
  const [first] = points;
  if (kind === "note" && first) return `POINT Z (${place(first)})`;
  if (kind === "area" && first) return `POLYGON Z ((${[...points, first].map(place).join(", ")}))`;
  return `LINESTRING Z (${points.map(place).join(", ")})`;
}

/** Spreadsheets take a text that begins so for a formula. */
const harmless = (text: string): string => (/^[=+\-@\t\r]/.test(text) ? `'${text}` : text);

/** RFC 4180, in UTF-8. */
export function csvOf({ unit, rows }: Sheet): string {
  const quoted = (text: string): string => (/[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  const u = unit.replaceAll(" ", "_");
  const header = ["name", "kind", "value", "error_95", "unit"]
    .concat([`horizontal_${u}`, `horizontal_error_95_${u}`, `vertical_${u}`, `vertical_error_95_${u}`, `wkt_${u}`]);
  const optional = (x: number | undefined): string => (x === undefined ? "" : number(x));
  const pair = (it: Partial<Valued> | undefined): string[] => [optional(it?.value), optional(it?.error)];
  const lines = rows.map((row) =>
    [harmless(row.name), row.kind, ...pair(row), unitOf(row.kind, unit), ...pair(row.horizontal), ...pair(row.vertical), wkt(row)],
  );
  return [header, ...lines].map((line) => `${line.map(quoted).join(",")}\r\n`).join("");
}

/** Lines of tabs, for a spreadsheet or a message. */
export function textOf({ unit, rows }: Sheet): string {
  const plain = (text: string): string => harmless(text.replaceAll(/[\t\r\n]/g, " "));
  return rows
    .map(({ name, kind, value, error }) => {
      const says = value === undefined ? "" : kind === "note" ? "" : measureText(kind, value, error ?? 0, unit);
      return `${plain(name)}\t${kind}\t${says}\n`;
    })
    .join("");
}

/** `crs` is null (GeoJSON of 2008): no geographic frame can be assumed. */
export function geojsonOf({ unit, scale, rows }: Sheet): string {
  const features = rows.map(({ name, kind, points, value, error, horizontal, vertical }) => {
    const [first] = points;
    const geometry =
      kind === "note"
        ? { type: "Point", coordinates: first }
        : kind === "area"
          ? { type: "Polygon", coordinates: [[...points, first]] }
          : { type: "LineString", coordinates: points };
    const properties = { name, kind, value, error_95: error, unit: unitOf(kind, unit), horizontal, vertical };
    return { type: "Feature", geometry, properties };
  });
  const frame = scale === 1 ? "frame of the cloud" : `frame of the cloud, scaled by ${number(scale)}`;
  return `${JSON.stringify({ type: "FeatureCollection", crs: null, coordinate_frame: `${frame}; not longitude and latitude`, unit, features }, null, 1)}\n`;
}

const dxfUnits: Record<string, number> = { ft: 2, mm: 4, cm: 5, m: 6, km: 7 };

/** ASCII DXF of AutoCAD R12, with the header variable for units of later releases. */
export function dxfOf({ unit, rows }: Sheet): string {
  const lines: string[] = [];
  const put = (code: number, value: string | number): void => void lines.push(String(code), String(value));
  const plain = (text: string): string =>
    [...text.replaceAll(/[\u0000-\u001f\u007f]/g, " ")]
      .map((c) => (c === "%" ? "%%%" : c === "±" ? "%%p" : c <= "~" ? c : c.split("").map((half) => `\\U+${half.charCodeAt(0).toString(16).padStart(4, "0").toUpperCase()}`).join("")))
      .join("")
      .slice(0, 255);
  const at = (p: Vec3): void => p.forEach((x, i) => put(10 * (i + 1), number(x)));
  put(999, `Lengths and coordinates in ${plain(unit)}, in the frame of the cloud`);
  for (const [code, value] of [[0, "SECTION"], [2, "HEADER"], [9, "$ACADVER"], [1, "AC1009"], [9, "$INSUNITS"], [70, dxfUnits[unit] ?? 0], [0, "ENDSEC"], [0, "SECTION"], [2, "ENTITIES"]] as const) {
    put(code, value);
  }
  for (const { name, kind, points, value, error } of rows) {
    const [first] = points;
    if (!first) continue;
    if (kind === "note") {
      put(0, "POINT");
      put(8, kind);
      at(first);
    } else {
      put(0, "POLYLINE");
      put(8, kind);
      put(66, 1);
      at([0, 0, 0]);
      put(70, kind === "area" ? 9 : 8); // in space; closed
      for (const point of points) {
        put(0, "VERTEX");
        put(8, kind);
        at(point);
        put(70, 32);
      }
      put(0, "SEQEND");
      put(8, kind);
    }
    const says = value === undefined ? name : `${name === "" ? kind : name}: ${number(Number(value.toPrecision(5)))} ± ${number(Number((error ?? 0).toPrecision(2)))} ${unitOf(kind, unit)}`;
    const size = Math.max(...points.map((p) => Math.hypot(p[0] - first[0], p[1] - first[1], p[2] - first[2])));
    put(0, "TEXT");
    put(8, kind);
    at(points.reduce<Vec3>((sum, p) => [sum[0] + p[0] / points.length, sum[1] + p[1] / points.length, sum[2] + p[2] / points.length], [0, 0, 0]));
    put(40, number(size > 0 ? 0.05 * size : 0.1));
    put(1, plain(says));
  }
  put(0, "ENDSEC");
  put(0, "EOF");
  return `${lines.join("\n")}\n`;
}
