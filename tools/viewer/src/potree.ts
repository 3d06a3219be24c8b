// SPDX-License-Identifier: BSD-2-Clause
// A Potree 2 cloud as pmsp-densify writes it (src/export/potree.cpp): an octree whose nodes hold each point once, not
// compressed. Whatever comes over the network is checked.
import { type NodePoints, kNoKeyframe } from "./data";
import { type Vec3, add, octahedral, sub } from "./geometry";

export interface PotreeNode {
  level: number;
  /** From the page's origin. */
  corner: Vec3;
  side: number;
  points: number;
  /** Of its points in octree.bin. */
  first: number;
  bytes: number;
  children: PotreeNode[];
}
export interface Potree {
  root: PotreeNode;
  points: number;
  pointBytes: number;
  offset: Vec3;
  scale: Vec3;
  /** Where each attribute begins within a point. */
  at: Record<string, number>;
}

const kNodeBytes = 22;
/** Attributes and their sizes. */
const kNeeded: Record<string, number> = { position: 12, rgb: 6, NormalX: 4, NormalY: 4, NormalZ: 4, confidence: 4, views: 1 };

function vector(value: unknown, what: string): Vec3 {
  const list = Array.isArray(value) ? value : [];
  const [x, y, z] = list as unknown[];
  if (typeof x === "number" && typeof y === "number" && typeof z === "number") return [x, y, z];
  throw new Error(`metadata.json has no ${what}`);
}

/** `origin`: of the page, in the frame of the file. */
export function potreeFrom(text: string, hierarchy: Uint8Array<ArrayBuffer>, origin: Vec3): Potree {
  const json = JSON.parse(text) as Record<string, unknown>;
  if (json["version"] !== "2.0" || json["encoding"] !== "DEFAULT") {
    throw new Error("metadata.json is of another version or encoding; expected 2.0 and DEFAULT");
  }
  const at: Record<string, number> = {};
  let pointBytes = 0;
  for (const it of (Array.isArray(json["attributes"]) ? json["attributes"] : []) as { name?: string; size?: number }[]) {
    if (it.name !== undefined && kNeeded[it.name] === it.size) at[it.name] = pointBytes;
    pointBytes += Number(it.size);
  }
  for (const name of Object.keys(kNeeded)) if (at[name] === undefined) throw new Error(`metadata.json has no ${name}`);
  const box = (json["boundingBox"] ?? {}) as Record<string, unknown>;
  const low = vector(box["min"], "boundingBox");
  const side = vector(box["max"], "boundingBox")[0] - low[0];
  const root = nodesFrom(hierarchy, sub(low, origin), side);
  const offset = sub(vector(json["offset"], "offset"), origin);
  return { root, points: Number(json["points"]), pointBytes, offset, scale: vector(json["scale"], "scale"), at };
}

/** Breadth first, all in one piece. */
function nodesFrom(bytes: Uint8Array<ArrayBuffer>, corner: Vec3, side: number): PotreeNode {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const root: PotreeNode = { level: 0, corner, side, points: 0, first: 0, bytes: 0, children: [] };
  const order = [root];
  for (let i = 0; i < order.length; ++i) {
    const node = order[i]!;
    const at = kNodeBytes * i;
    if (at + kNodeBytes > bytes.length) throw new Error("hierarchy.bin ends too early");
    if (view.getUint8(at) > 1) throw new Error("hierarchy.bin comes in pieces; expected one, as pmsp-densify writes it");
    const mask = view.getUint8(at + 1);
    node.points = view.getUint32(at + 2, true);
    node.first = Number(view.getBigUint64(at + 6, true));
    node.bytes = Number(view.getBigUint64(at + 14, true));
    const half = node.side / 2;
    for (let k = 0; k < 8; ++k) {
      if ((mask & (1 << k)) === 0) continue;
      const octant: Vec3 = [k & 4 ? half : 0, k & 2 ? half : 0, k & 1 ? half : 0];
      const child = { level: node.level + 1, corner: add(node.corner, octant), side: half, points: 0, first: 0, bytes: 0, children: [] };
      node.children.push(child);
      order.push(child);
    }
  }
  return root;
}

/** A node's points, in its cube. They do not say which keyframe made them. */
export function potreePoints(tree: Potree, node: PotreeNode, bytes: Uint8Array<ArrayBuffer>): NodePoints {
  const count = node.points;
  if (bytes.length !== count * tree.pointBytes) {
    throw new Error(`a node of octree.bin has ${bytes.length} bytes; expected ${count * tree.pointBytes}`);
  }
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const positions = new Uint16Array(4 * count);
  const colors = new Uint8Array(4 * count);
  const normalsAndViews = new Uint8Array(4 * count);
  const at = (name: string): number => tree.at[name] ?? 0;
  const [position, rgb, confidence, views] = [at("position"), at("rgb"), at("confidence"), at("views")];
  const normal = [at("NormalX"), at("NormalY"), at("NormalZ")] as const;
  for (let i = 0; i < count; ++i) {
    const begin = i * tree.pointBytes;
    for (const k of [0, 1, 2] as const) {
      const x = view.getInt32(begin + position + 4 * k, true) * tree.scale[k] + tree.offset[k];
      const share = (x - node.corner[k]) / node.side;
      positions[4 * i + k] = Math.round(65535 * Math.max(0, Math.min(1, share)));
      colors[4 * i + k] = view.getUint16(begin + rgb + 2 * k, true) >> 8;
    }
    const sure = view.getFloat32(begin + confidence, true);
    colors[4 * i + 3] = Math.round(255 * Math.max(0, Math.min(1, sure)));
    const n = (k: 0 | 1 | 2): number => view.getFloat32(begin + normal[k], true);
    const [u, v] = octahedral([n(0), n(1), n(2)]);
    normalsAndViews[4 * i] = u & 255;
    normalsAndViews[4 * i + 1] = v & 255;
    normalsAndViews[4 * i + 2] = view.getUint8(begin + views);
  }
  return { count, positions, colors, normalsAndViews, keyframes: new Uint16Array(count).fill(kNoKeyframe) };
}
