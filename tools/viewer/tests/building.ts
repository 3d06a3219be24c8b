// SPDX-License-Identifier: BSD-2-Clause
// A page with a building of two storeys, made without pmsp-densify: an octree of points as src/export/page_cloud.cpp
// makes it.
import { readFileSync } from "node:fs";
import { join } from "node:path";
import type { KeyframeData, ReportData } from "../src/data";
import { type Vec3, octahedral } from "../src/geometry";

interface Point {
  at: Vec3;
  normal: Vec3;
  color: Vec3;
}

/** Sides, of the whole building [m]. */
export const kSides: Vec3 = [10, 6, 6];
/** Heights of the floors. The slab below the second one is 0.3 m thick. */
export const kFloors = [0, 3] as const;
/** Of the cameras above their floor. */
export const kEyeHeight = 1.5;
/** About the vertical; the walls are turned by that against the axes of the map [rad]. */
export const kTurn = 0.4;
const kCells = 128;

/** mulberry32 */
function randomNumbers(seed: number): () => number {
  let state = seed;
  return () => {
    state = (state + 0x6d2b79f5) | 0;
    let x = Math.imul(state ^ (state >>> 15), 1 | state);
    x = (x + Math.imul(x ^ (x >>> 7), 61 | x)) ^ x;
    return ((x ^ (x >>> 14)) >>> 0) / 2 ** 32;
  };
}

const turned = ([x, y, z]: Vec3): Vec3 => [
  Math.cos(kTurn) * x - Math.sin(kTurn) * y,
  Math.sin(kTurn) * x + Math.cos(kTurn) * y,
  z,
];

/** Points on floors, ceilings and walls, seen from within, and strays around. z is up. */
function points(count: number): Point[] {
  const random = randomNumbers(1);
  const made: Point[] = [];
  const [wide, deep] = kSides;
  const put = (at: Vec3, normal: Vec3, tone: Vec3): void => {
    const check = (Math.floor(2 * at[0]) + Math.floor(2 * at[1]) + Math.floor(2 * at[2])) & 1;
    made.push({ at: turned(at), normal: turned(normal), color: [tone[0] - 60 * check, tone[1] - 60 * check, tone[2] - 60 * check] });
  };
  for (let i = 0; i < count; ++i) {
    if (random() < 0.001) {
      put([60 * random() - 25, 60 * random() - 25, 40 * random() - 15], [0, 0, 1], [255, 80, 80]);
      continue;
    }
    const floor = kFloors[random() < 0.5 ? 0 : 1];
    const [u, v] = [random(), random()];
    const which = random();
    if (which < 0.3) put([wide * u, deep * v, floor], [0, 0, 1], [200, 170, 130]);
    else if (which < 0.55) put([wide * u, deep * v, floor + 2.7], [0, 0, -1], [230, 230, 230]);
    else if (which < 0.65) put([0, deep * u, floor + 2.7 * v], [1, 0, 0], [190, 200, 220]);
    else if (which < 0.75) put([wide, deep * u, floor + 2.7 * v], [-1, 0, 0], [190, 220, 200]);
    else if (which < 0.87) put([wide * u, 0, floor + 2.7 * v], [0, 1, 0], [220, 200, 190]);
    else put([wide * u, deep, floor + 2.7 * v], [0, -1, 0], [210, 210, 180]);
  }
  return made;
}

interface Node {
  level: number;
  corner: Vec3;
  side: number;
  points: Point[];
}

/** Each cell of a node keeps one point; the others go to the children. */
function octree(all: Point[], corner: Vec3, side: number): Node[] {
  const nodes: Node[] = [];
  for (let level: Node[] = [{ level: 0, corner, side, points: all }]; level.length > 0; ) {
    const next: Node[] = [];
    for (const node of level) {
      const taken = new Set<number>();
      const kept: Point[] = [];
      const rest = new Map<number, Point[]>();
      for (const point of node.points) {
        const share = point.at.map((x, i) => (x - node.corner[i as 0]) / node.side);
        const cell = share.reduce((sum, x) => sum * kCells + Math.floor(kCells * x), 0);
        if (!taken.has(cell)) {
          taken.add(cell);
          kept.push(point);
          continue;
        }
        const octant = share.reduce((sum, x) => 2 * sum + (x >= 0.5 ? 1 : 0), 0);
        const others = rest.get(octant);
        if (others) others.push(point);
        else rest.set(octant, [point]);
      }
      const half = node.side / 2;
      for (const [octant, points] of [...rest].sort((a, b) => a[0] - b[0])) {
        const at: Vec3 = [
          node.corner[0] + (octant & 4 ? half : 0),
          node.corner[1] + (octant & 2 ? half : 0),
          node.corner[2] + (octant & 1 ? half : 0),
        ];
        next.push({ level: node.level + 1, corner: at, side: half, points });
      }
      nodes.push({ ...node, points: kept });
    }
    level = next;
  }
  return nodes;
}

/** A node's points, field by field. */
function bytesOf(node: Node): Buffer {
  const count = node.points.length;
  const bytes = Buffer.alloc(15 * count);
  node.points.forEach(({ at, normal, color }, i) => {
    at.forEach((x, k) => bytes.writeUInt16LE(Math.round((65535 * (x - node.corner[k as 0])) / node.side), 6 * i + 2 * k));
    color.forEach((x, k) => bytes.writeUInt8(Math.max(0, Math.min(255, x)), 6 * count + 3 * i + k));
    bytes.writeUInt8(200, 9 * count + i);
    bytes.writeUInt8(5, 10 * count + i);
    const [a, b] = octahedral(normal);
    bytes.writeInt8(a, 11 * count + 2 * i);
    bytes.writeInt8(b, 11 * count + 2 * i + 1);
    bytes.writeUInt16LE(65535, 13 * count + 2 * i);
  });
  return bytes;
}

/** Eight keyframes on each storey, along x. */
function keyframes(): KeyframeData[] {
  const made: KeyframeData[] = [];
  for (const floor of kFloors) {
    for (let i = 0; i < 8; ++i) {
      const along = 1 + (8 * (floor === 0 ? i : 7 - i)) / 7;
      const center = turned([along, 3 + 0.3 * (i % 2), floor + kEyeHeight]);
      // Right, down and forward of the camera, which looks along x of the building.
      const rows = [turned([0, -1, 0]), [0, 0, -1], turned([1, 0, 0])];
      made.push({ id: made.length, use: "depth map", center, rotation: rows.flat(), coverage: 0.9, confidence: 0.8 });
    }
  }
  return made;
}

/** The page, as text. `change`: of what it says. */
export function buildingPage(count: number, change: (data: ReportData) => void = () => {}): string {
  const nodes = octree(points(count), [-64, -64, -64], 128);
  const data: ReportData = {
    format: "pmsp-report",
    version: 1,
    title: "Building",
    generator: "pmsp-densify",
    unit: "m",
    up: [0, 0, 1],
    origin: [0, 0, 0],
    points_in: count,
    points: nodes.reduce((sum, node) => sum + node.points.length, 0),
    nodes: nodes.map((node) => ({ level: node.level, corner: node.corner, side: node.side, points: node.points.length })),
    normals: true,
    keyframes: keyframes(),
    confidences: [0, 0, 0, 0, 0, 0, 0, count, 0, 0],
    pixel: 0.01,
    facts: [],
    times: [],
    problems: [],
    notes: [],
  };
  change(data);
  const block = (id: string, type: string, text: string): string => `<script type="${type}" id="pmsp-${id}">${text}</script>\n`;
  const blocks = nodes.map((node, i) => block(`node-${i}`, "application/octet-stream", bytesOf(node).toString("base64")));
  const json = block("data", "application/json", JSON.stringify(data).replaceAll("<", "\\u003c"));
  const template = readFileSync(join(process.cwd(), "prebuilt", "report.html"), "utf8");
  return template.replace("<!--PMSP-DATA-->", () => json + blocks.join(""));
}
