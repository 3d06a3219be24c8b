// SPDX-License-Identifier: BSD-2-Clause
import assert from "node:assert/strict";
import { test } from "node:test";
import { type Sheet, csvOf, dxfOf, geojsonOf, textOf } from "../src/exports";

const hurtful = '=HYPERLINK("http://x")\n"a",±%ä';
const sheet: Sheet = {
  unit: "ft",
  scale: 2,
  rows: [
    { name: "door", kind: "distance", points: [[0, 0, 1], [3, 4, 1]], value: 5, error: 0.25, horizontal: { value: 5, error: 0.25 }, vertical: { value: 0, error: 0.1 } },
    { name: "", kind: "angle", points: [[1, 0, 0], [0, 0, 0], [0, 1, 0]], value: 90, error: 1.5 },
    { name: hurtful, kind: "area", points: [[0, 0, 0], [2, 0, 0], [2, 2, 0]], value: 2, error: 0.125 },
    { name: "look; here", kind: "note", points: [[500000.125, 5300000.25, 7]] },
  ],
};

/** RFC 4180. */
function recordsOf(text: string): string[][] {
  const records: string[][] = [];
  let [record, field, isQuoted]: [string[], string, boolean] = [[], "", false];
  for (let i = 0; i < text.length; ++i) {
    const c = text[i]!;
    if (isQuoted && c === '"' && text[i + 1] === '"') field += text[++i];
    else if (c === '"') isQuoted = !isQuoted;
    else if (!isQuoted && c === ",") [record, field] = [[...record, field], ""];
    else if (!isQuoted && c === "\r" && text[i + 1] === "\n") {
      records.push([...record, field]);
      [record, field, i] = [[], "", i + 1];
    } else field += c;
  }
  assert.equal(isQuoted, false);
  assert.equal(field, "");
  return records;
}

test("CSV has values, errors, parts and places in one unit that its columns name", () => {
  const [header, ...lines] = recordsOf(csvOf(sheet));
  assert.deepEqual(header, ["name", "kind", "value", "error_95", "unit", "horizontal_ft", "horizontal_error_95_ft", "vertical_ft", "vertical_error_95_ft", "wkt_ft"]);
  assert.deepEqual(lines[0], ["door", "distance", "5", "0.25", "ft", "5", "0.25", "0", "0.1", "LINESTRING Z (0 0 1, 3 4 1)"]);
  assert.deepEqual(lines.map((line) => line[4]), ["ft", "deg", "ft2", ""]);
  assert.equal(lines[2]?.[9], "POLYGON Z ((0 0 0, 2 0 0, 2 2 0, 0 0 0))");
  assert.deepEqual(lines[3], ["look; here", "note", "", "", "", "", "", "", "", "POINT Z (500000.125 5300000.25 7)"]);
  assert.ok(lines.every((line) => line.length === header.length));
});

test("no name becomes a formula of a spreadsheet, nor another column or line", () => {
  assert.equal(recordsOf(csvOf(sheet))[3]?.[0], `'${hurtful}`);
  for (const name of ["+1", "-1", "@x", "\tx"]) {
    assert.equal(recordsOf(csvOf({ ...sheet, rows: [{ name, kind: "note", points: [[0, 0, 0]] }] }))[1]?.[0], `'${name}`);
  }
  const lines = textOf(sheet).split("\n");
  assert.equal(lines.length, 5);
  assert.ok(lines.slice(0, 4).every((line) => line.split("\t").length === 3));
  assert.equal(lines[0], "door\tdistance\t5.00 ± 0.25 ft");
});

test("GeoJSON is read back, with its unit and a frame that is not geographic", () => {
  const read = JSON.parse(geojsonOf(sheet));
  assert.deepEqual([read.type, read.crs, read.unit], ["FeatureCollection", null, "ft"]);
  assert.match(read.coordinate_frame, /^frame of the cloud, scaled by 2; not longitude and latitude$/);
  assert.deepEqual(read.features.map((it: any) => it.geometry.type), ["LineString", "LineString", "Polygon", "Point"]);
  assert.deepEqual(read.features[2].geometry.coordinates, [[[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 0, 0]]]);
  assert.deepEqual(read.features[0].properties, {
    name: "door", kind: "distance", value: 5, error_95: 0.25, unit: "ft",
    horizontal: { value: 5, error: 0.25 }, vertical: { value: 0, error: 0.1 },
  });
  assert.equal(read.features[2].properties.name, hurtful);
  assert.equal(read.features[2].properties.unit, "ft2");
});

test("DXF is read back: pairs of codes and values, its unit, closed areas, plain texts", () => {
  const lines = dxfOf(sheet).trimEnd().split("\n");
  assert.equal(lines.length % 2, 0);
  const pairs = Array.from({ length: lines.length / 2 }, (_, i): [number, string] => [Number(lines[2 * i]), lines[2 * i + 1]!]);
  assert.ok(pairs.every(([code, value]) => Number.isInteger(code) && /^[ -~]*$/.test(value)));
  assert.match(pairs[0]![1], /in ft/);
  assert.deepEqual(pairs.at(-1), [0, "EOF"]);
  const units = pairs.findIndex(([code, value]) => code === 9 && value === "$INSUNITS");
  assert.deepEqual(pairs[units + 1], [70, "2"]);
  const entities: [number, string][][] = [];
  for (const pair of pairs.slice(pairs.findIndex(([, value]) => value === "ENTITIES") + 1)) {
    if (pair[0] === 0) entities.push([]);
    entities.at(-1)!.push(pair);
  }
  const get = (entity: [number, string][], code: number): string | undefined => entity.find((it) => it[0] === code)?.[1];
  const called = (name: string): [number, string][][] => entities.filter((it) => it[0]![1] === name);
  assert.deepEqual(called("POLYLINE").map((it) => [get(it, 8), get(it, 70)]), [["distance", "8"], ["angle", "8"], ["area", "9"]]);
  assert.deepEqual(
    called("VERTEX").slice(0, 2).map((it) => [10, 20, 30].map((code) => Number(get(it, code)))),
    [[0, 0, 1], [3, 4, 1]],
  );
  assert.equal(called("VERTEX").length, 2 + 3 + 3);
  assert.equal(called("SEQEND").length, 3);
  assert.deepEqual([10, 20, 30].map((code) => Number(get(called("POINT")[0]!, code))), [500000.125, 5300000.25, 7]);
  const texts = called("TEXT").map((it) => get(it, 1)!);
  assert.equal(texts[0], "door: 5 %%p 0.25 ft");
  assert.match(texts[2]!, /^=HYPERLINK\("http:\/\/x"\) "a",%%p%%%\\U\+00E4: 2 %%p 0\.13 ft2$/);
});
