// SPDX-License-Identifier: BSD-2-Clause
// Size of points: the spacing of the finest drawn cube at their place, so that points of coarse cubes do not cover finer
// ones. The vertex shader descends from the cube of a point through a texture of the drawn octree.
import { DataTexture, FloatType, NearestFilter, RGBAFormat } from "three";
import type { NodePoints } from "./data";
import type { Vec3 } from "./geometry";

/** Cells per side for the area that points cover. */
const kAreaCells = 16;
/** Spacing of unevenly spread points, in that of as many evenly spread ones. */
const kUneven = 1.2;
/** Spacing of a keyframe's points, in that of all keyframes that see the same. */
const kOverlapping = 2;
/** Most spacing, in the usual one: what is sparser is strays. */
const kMostSpacing = 4;
const kTextureWidth = 256;

/** Node of the octree, with or without points in memory. */
export interface DetailNode {
  level: number;
  side: number;
  parent: DetailNode | null;
  children: (DetailNode | null)[];
  points: number;
  /** Median point spacing, those of coarser cubes included; 0 = no points. */
  spacing: number;
  /** Points per side^2 of the surfaces in it, without those of coarser cubes. */
  density: number;
  /** Row of the texture. */
  index: number;
  isDrawn: boolean;
  /** Last update with it or with a node below it. */
  update: number;
}

/** Points in a cell of these: a third of all lie in cells with fewer. */
function usualCount(counts: Uint32Array): number {
  const sorted = counts.filter((n) => n > 0).sort();
  const all = sorted.reduce((sum, n) => sum + n, 0);
  let sum = 0;
  return sorted.find((n) => 3 * (sum += n) >= all) ?? 0;
}

/** Points per side^2 of the surfaces in a cube. */
function densityOf(points: NodePoints): number {
  const counts = new Uint32Array(kAreaCells ** 3);
  for (let i = 0; i < points.count; ++i) {
    const cell = (k: number): number => (points.positions[4 * i + k] ?? 0) >> 12;
    counts[(cell(0) * kAreaCells + cell(1)) * kAreaCells + cell(2)]! += 1;
  }
  return usualCount(counts) * kAreaCells ** 2;
}

/**
 * Spacing, at distance 1, of points that a camera saw, with those of as many other keyframes in between; `eye`: the
 * camera's centre in the points' unit cube. 0 = no points.
 */
export function angularSpacing(points: NodePoints, eye: Vec3): number {
  const counts = new Uint32Array(2 * kAreaCells * kAreaCells);
  for (let i = 0; i < points.count; ++i) {
    const [x, y, z] = eye.map((e, k) => (points.positions[4 * i + k] ?? 0) / 65535 - e) as [number, number, number];
    const across = Math.min(0.5 + Math.atan2(x, z) / (2 * Math.PI), 0.999999);
    const down = Math.min(0.5 + y / (2 * Math.max(Math.hypot(x, y, z), 1e-9)), 0.999999); // equal heights, equal areas
    counts[Math.floor(down * kAreaCells) * 2 * kAreaCells + Math.floor(across * 2 * kAreaCells)]! += 1;
  }
  const usual = usualCount(counts);
  return usual > 0 ? (kUneven / kOverlapping) * Math.sqrt((4 * Math.PI) / counts.length / usual) : 0;
}

export class Detail {
  texture = Detail.textureOf(new Float32Array(4 * kTextureWidth));
  private root: DetailNode | null = null;
  private corner: Vec3 = [0, 0, 0];
  private updates = 0;

  private static textureOf(data: Float32Array<ArrayBuffer>): DataTexture {
    const made = new DataTexture(data, kTextureWidth, data.length / (4 * kTextureWidth), RGBAFormat, FloatType);
    made.minFilter = made.magFilter = NearestFilter;
    made.needsUpdate = true;
    return made;
  }

  /** Returns the node of a cube, null if it is outside the octree of the first cube of level 0. */
  nodeOf(level: number, corner: Vec3, side: number): DetailNode | null {
    const node = (level: number, side: number, parent: DetailNode | null): DetailNode => {
      const children = new Array<DetailNode | null>(8).fill(null);
      return { level, side, parent, children, points: 0, spacing: 0, density: 0, index: 0, isDrawn: false, update: 0 };
    };
    if (!this.root) {
      if (level !== 0) return null;
      this.root = node(0, side, null);
      this.corner = corner;
    }
    let at = this.root;
    const center = corner.map((x, i) => (x + side / 2 - (this.corner[i as 0] ?? 0)) / at.side);
    if (center.some((x) => !(x > 0 && x < 1))) return null;
    for (let below = 1; below <= level; ++below) {
      const octant = center.reduce((sum, x) => 2 * sum + (Math.floor(x * 2 ** below) & 1), 0);
      at = at.children[octant] ??= node(below, at.side / 2, at);
    }
    return at;
  }

  /** The points of a node have changed; null = it has none. */
  static setPoints(node: DetailNode, points: NodePoints | null): void {
    node.density = points ? densityOf(points) : 0;
    node.points = points?.count ?? 0;
    Detail.setSpacing(node);
  }

  private static setSpacing(node: DetailNode): void {
    let [density, above] = [0, Number.POSITIVE_INFINITY];
    for (let it: DetailNode | null = node; it; it = it.parent) {
      density += it.density / (it.side * it.side);
      if (it !== node && it.spacing > 0) above = Math.min(above, it.spacing);
    }
    node.spacing = node.density > 0 ? Math.min(above, kUneven / Math.sqrt(density)) : 0;
    for (const child of node.children) if (child) Detail.setSpacing(child);
  }

  /** Half of the points are spaced more narrowly. */
  private static usualSpacing(nodes: readonly DetailNode[]): number {
    const half = nodes.reduce((sum, node) => sum + node.points, 0) / 2;
    let sum = 0;
    return [...nodes].sort((a, b) => a.spacing - b.spacing).find((node) => (sum += node.points) >= half)?.spacing ?? 0;
  }

  /** Writes the texture for the nodes to draw. */
  show(drawn: readonly DetailNode[]): void {
    this.updates += 1;
    for (const node of drawn) {
      for (let it: DetailNode | null = node; it && it.update !== this.updates; it = it.parent) {
        it.update = this.updates;
        it.isDrawn = false;
      }
    }
    for (const node of drawn) node.isDrawn = true;
    const most = kMostSpacing * Detail.usualSpacing(drawn);
    const order: DetailNode[] = this.root?.update === this.updates ? [this.root] : [];
    const values: number[] = [];
    for (let i = 0; i < order.length; ++i) {
      const node = order[i]!;
      node.index = i;
      let mask = 0;
      const first = order.length;
      node.children.forEach((child, octant) => {
        if (child?.update !== this.updates) return;
        mask |= 1 << octant;
        order.push(child);
      });
      values.push(mask, first, node.isDrawn ? Math.min(node.spacing, most) : 0, 0);
    }
    const capacity = this.texture.image.data as Float32Array<ArrayBuffer>;
    if (values.length > capacity.length) {
      this.texture.dispose();
      const rows = 2 * Math.ceil(values.length / (4 * kTextureWidth));
      this.texture = Detail.textureOf(new Float32Array(4 * kTextureWidth * rows));
    }
    (this.texture.image.data as Float32Array<ArrayBuffer>).set(values);
    this.texture.needsUpdate = true;
  }
}

export const detailShader = `
uniform highp sampler2D nodes; uniform int node; uniform float spacing; uniform vec3 eyeOfCube;
// At a place of the unit cube. Points of a keyframe are spaced as they are far from its camera.
float spacingAt(vec3 p) {
  if (node < 0) return spacing * distance(p, eyeOfCube);
  vec4 here = texelFetch(nodes, ivec2(node & 255, node >> 8), 0);
  float found = here.z;
  for (int level = 0; level < 20; ++level) {
    vec3 upper = step(0.5, p);
    int octant = int(dot(upper, vec3(4.0, 2.0, 1.0))), mask = int(here.x);
    if ((mask & (1 << octant)) == 0) break;
    int before = mask & ((1 << octant) - 1);
    before = (before & 0x55) + ((before >> 1) & 0x55);
    before = (before & 0x33) + ((before >> 2) & 0x33);
    int next = int(here.y) + (before & 15) + (before >> 4);
    here = texelFetch(nodes, ivec2(next & 255, next >> 8), 0);
    p = 2.0 * p - upper;
    if (here.z > 0.0) found = here.z;
  }
  return found;
}
`;
