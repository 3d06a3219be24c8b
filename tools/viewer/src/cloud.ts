// SPDX-License-Identifier: BSD-2-Clause
// The points: on the GPU cube by cube, and in memory for picking.
import {
  BufferAttribute,
  BufferGeometry,
  type Camera,
  DataTexture,
  Group,
  LinearFilter,
  Matrix3,
  Matrix4,
  Points,
  RawShaderMaterial,
  GLSL3,
  NoColorSpace,
  Vector2,
  Vector3,
} from "three";
import { type NodeData, type NodePoints, kNoKeyframe } from "./data";
import { busyBox } from "./framing";
import { type Vec3, dot, norm, normalFrom, sub } from "./geometry";
import type { Found } from "./measure";
import { type PaletteName, paletteBytes } from "./palette";
import { fragmentShader, vertexShader } from "./shaders";
import { isPerspective, Sight } from "./sight";
import { type Coloring, colorings } from "./state";

export interface Cube {
  /** Of the octree. */
  level: number;
  corner: Vec3;
  /** From the unit cube to its parent frame: of a keyframe, else of the page. */
  local: Matrix4;
  /** From the unit cube to the page. */
  matrix: Matrix4;
  side: number;
  center: Vector3;
  /** Of the ball around it. */
  radius: number;
  points: NodePoints | null;
  /** Points embedded in the page. */
  held: NodePoints | null;
  drawn: Points | null;
  /** Between points; 0 = as everywhere. */
  spacing: number;
}

/** Which palette a colouring takes; null = none. */
export const paletteOf = (coloring: Coloring): PaletteName | null =>
  coloring === "height" || coloring === "views" ? "viridis" : coloring === "confidence" ? "cividis" : null;

function texture(name: PaletteName): DataTexture {
  const made = new DataTexture(paletteBytes(name), 256, 1);
  made.colorSpace = NoColorSpace;
  made.minFilter = made.magFilter = LinearFilter;
  made.needsUpdate = true;
  return made;
}

export class Cloud {
  readonly group = new Group();
  cubes: Cube[];
  /** Cubes of keyframes, by keyframe id. */
  private readonly keyframeCubes = new Map<string, Cube>();
  loaded = 0;
  /** Points that may be drawn at a time. */
  budget = 3_000_000;
  drawnPoints = 0;
  /** Robust bounds along `basis` (framing.ts). */
  low: Vec3 = [-1, -1, -1];
  high: Vec3 = [1, 1, 1];
  private readonly palettes = { viridis: texture("viridis"), cividis: texture("cividis") };
  private readonly material: RawShaderMaterial;

  constructor(
    nodes: readonly NodeData[],
    readonly basis: readonly [Vec3, Vec3, Vec3],
  ) {
    this.cubes = nodes.map((node) => this.newCube(node.level, node.corner, node.side));
    const [a, b, c] = basis;
    this.material = new RawShaderMaterial({
      glslVersion: GLSL3,
      vertexShader,
      fragmentShader,
      uniforms: {
        basis: { value: new Matrix3(...a, ...b, ...c) },
        low: { value: new Vector3() },
        high: { value: new Vector3() },
        heights: { value: new Vector2() },
        coloring: { value: 0 },
        facing: { value: false },
        size: { value: 0.01 },
        focalLength: { value: 1000 },
        maxPointSize: { value: 24 },
        palette: { value: this.palettes.viridis },
      },
    });
    this.spacing = usualSpacing(nodes);
  }

  private spacing: number;
  private isSpacingOutdated = false;
  /** Of points, times the usual one. */
  private pointSize = 1;

  newCube(level: number, corner: Vec3, side: number): Cube {
    const local = new Matrix4().makeTranslation(...corner).scale(new Vector3(side, side, side));
    const center = new Vector3(...corner).addScalar(side / 2);
    const radius = (side * Math.sqrt(3)) / 2;
    return { level, corner, local, matrix: local.clone(), side, center, radius, points: null, held: null, drawn: null, spacing: 0 };
  }

  /** Takes the points of a cube of the page. */
  fill(which: number, points: NodePoints): void {
    const cube = this.cubes[which];
    if (!cube) return;
    cube.held = points;
    this.exchange(cube, points);
  }

  /** Gives a cube other points; null = those that the page holds of it. */
  exchange(cube: Cube, points: NodePoints | null): void {
    this.detach(cube);
    const given = points ?? cube.held;
    if (given) this.attach(cube, given);
  }

  /** Sets or replaces the points of a keyframe. `page`: from the keyframe's frame to the page. */
  setKeyframePoints(id: string, page: Matrix4, block: { corner: Vec3; side: number; points: NodePoints }): void {
    this.remove(id);
    const cube = this.newCube(0, block.corner, block.side);
    this.keyframeCubes.set(id, cube);
    this.cubes.push(cube);
    this.attach(cube, block.points);
    this.move(id, page);
  }

  /** Sets the pose of a keyframe. */
  move(id: string, page: Matrix4): void {
    const cube = this.keyframeCubes.get(id);
    if (!cube) return;
    cube.matrix.multiplyMatrices(page, cube.local);
    cube.center.set(0.5, 0.5, 0.5).applyMatrix4(cube.matrix);
    cube.side = cube.matrix.getMaxScaleOnAxis();
    cube.radius = (cube.side * Math.sqrt(3)) / 2;
    this.isSpacingOutdated = true;
    cube.drawn?.matrix.copy(cube.matrix);
    if (cube.drawn) cube.drawn.matrixWorldNeedsUpdate = true;
  }

  remove(id: string): void {
    const cube = this.keyframeCubes.get(id);
    if (!cube) return;
    this.keyframeCubes.delete(id);
    this.cubes = this.cubes.filter((it) => it !== cube);
    this.detach(cube);
  }

  private detach(cube: Cube): void {
    this.loaded -= cube.points?.count ?? 0;
    cube.points = null;
    if (!cube.drawn) return;
    this.group.remove(cube.drawn);
    cube.drawn.geometry.dispose();
    cube.drawn = null;
  }

  private attach(cube: Cube, points: NodePoints): void {
    cube.points = points;
    this.loaded += points.count;
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(points.positions, 4, true));
    geometry.setAttribute("rgbc", new BufferAttribute(points.colors, 4, true));
    geometry.setAttribute("normal_views", new BufferAttribute(points.normalsAndViews, 4, true));
    const drawn = new Points(geometry, this.material);
    drawn.frustumCulled = false;
    drawn.matrixAutoUpdate = false;
    drawn.matrix.copy(cube.matrix);
    drawn.onBeforeRender = () => {
      this.material.uniforms["size"]!.value = 1.6 * this.pointSize * (cube.spacing || this.spacing);
      this.material.uniformsNeedUpdate = true;
    };
    cube.drawn = drawn;
    this.group.add(drawn);
  }

  /** Looks at every so many points for `low` and `high`. `path`: of the camera, which is in it. */
  measureExtent(path: readonly Vec3[] = []): void {
    const inPlan = (p: Vec3): Vec3 => [dot(this.basis[0], p), dot(this.basis[1], p), dot(this.basis[2], p)];
    const points: Vec3[] = [];
    const stride = Math.max(1, Math.floor(this.loaded / 50_000));
    this.forEach(stride, (x, y, z) => points.push(inPlan([x, y, z])));
    const box = busyBox(points, path.map(inPlan));
    if (box) [this.low, this.high] = [box.low, box.high];
  }

  /** Every so many points. */
  forEach(stride: number, visit: (x: number, y: number, z: number) => void): void {
    let number = 0;
    for (const cube of this.cubes) {
      for (let i = 0; i < (cube.points?.count ?? 0); ++i) {
        if (number++ % stride === 0) visit(...this.positionOf(cube, i));
      }
    }
  }

  /** All points of a cube; number by number, since there may be millions. */
  visit(cube: Cube, visit: (x: number, y: number, z: number, i: number) => void): void {
    const [xx, xy, xz, , yx, yy, yz, , zx, zy, zz, , x0, y0, z0] = cube.matrix.elements;
    const positions = cube.points?.positions ?? [];
    for (let i = 0; i < (cube.points?.count ?? 0); ++i) {
      const a = positions[4 * i]! / 65535;
      const b = positions[4 * i + 1]! / 65535;
      const c = positions[4 * i + 2]! / 65535;
      visit(xx * a + yx * b + zx * c + x0, xy * a + yy * b + zy * c + y0, xz * a + yz * b + zz * c + z0, i);
    }
  }

  /** `clip`: low and high share of the extent along each axis; 0 and 1 leave all in. `facing`: only surfaces seen from the front. */
  setLook(coloring: Coloring, size: number, clip: readonly number[], facing: boolean): void {
    const u = this.material.uniforms;
    const corner = (end: 0 | 1): Vector3 => {
      const at = [0, 1, 2].map((i) => {
        const share = clip[2 * i + end] ?? end;
        if (share === end) return end === 0 ? -1e30 : 1e30;
        return (this.low[i as 0] ?? 0) + share * ((this.high[i as 0] ?? 0) - (this.low[i as 0] ?? 0));
      });
      return new Vector3(at[0], at[1], at[2]);
    };
    u["low"]!.value = corner(0);
    u["high"]!.value = corner(1);
    u["heights"]!.value = new Vector2(this.low[2], this.high[2]);
    u["facing"]!.value = facing;
    u["coloring"]!.value = colorings.indexOf(coloring);
    this.pointSize = size;
    u["palette"]!.value = this.palettes[paletteOf(coloring) ?? "viridis"];
  }

  private updateSpacing(): void {
    this.isSpacingOutdated = false;
    // Half the side: several overlapping keyframes cover a surface, with points in between those of one cube.
    this.spacing = usualSpacing(this.cubes.map((it) => ({ side: it.side / 2, points: it.points?.count ?? 0 })));
  }

  /**
   * Selects the cubes to draw: largest on screen first, within `budget`. `focalLength`: of a unit at distance 1, or of
   * a unit of a flat view [px].
   */
  choose(camera: Camera, focalLength: number, ratio: number): void {
    this.material.uniforms["focalLength"]!.value = focalLength;
    this.material.uniforms["maxPointSize"]!.value = 28 * ratio;
    if (this.isSpacingOutdated) this.updateSpacing();
    const sight = new Sight(camera);
    const visible: [Cube, number][] = [];
    for (const cube of this.cubes) {
      if (!cube.drawn) continue;
      cube.drawn.visible = false;
      const size = sight.sizeOf(cube.center, cube.radius);
      if (size > 0) visible.push([cube, size]);
    }
    visible.sort((a, b) => b[1] - a[1]);
    this.drawnPoints = 0;
    for (const [cube] of visible) {
      const count = cube.points?.count ?? 0;
      if (this.drawnPoints + count > this.budget && this.drawnPoints > 0) break;
      if (cube.drawn) cube.drawn.visible = true;
      this.drawnPoints += count;
    }
  }

  /**
   * The point at a place of the picture: of those within `radius` pixels that lie in front, the one that is near and
   * well known. Snaps so to points, never to what lies between them.
   */
  pick(camera: Camera, x: number, y: number, width: number, height: number, radius: number): Found | null {
    const m = new Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
    const found: { depth: number; off: number; cube: Cube; i: number }[] = [];
    for (const cube of this.cubes) {
      const points = cube.points;
      if (!points) continue;
      const step = new Matrix4().makeScale(1 / 65535, 1 / 65535, 1 / 65535);
      const e = step.premultiply(cube.matrix).premultiply(m).elements;
      const [e0, e1, e3, e4, e5, e7] = [e[0]!, e[1]!, e[3]!, e[4]!, e[5]!, e[7]!];
      const [e8, e9, e11, e12, e13, e15] = [e[8]!, e[9]!, e[11]!, e[12]!, e[13]!, e[15]!];
      const positions = points.positions;
      for (let i = 0; i < points.count; ++i) {
        const px = positions[4 * i]!;
        const py = positions[4 * i + 1]!;
        const pz = positions[4 * i + 2]!;
        const w = e3 * px + e7 * py + e11 * pz + e15;
        if (w <= 1e-9) continue;
        const dx = ((e0 * px + e4 * py + e8 * pz + e12) / w + 1) * 0.5 * width - x;
        if (dx > radius || dx < -radius) continue;
        const dy = (1 - (e1 * px + e5 * py + e9 * pz + e13) / w) * 0.5 * height - y;
        if (dx * dx + dy * dy > radius * radius) continue;
        const depth = e[2]! * px + e[6]! * py + e[10]! * pz + e[14]!;
        const at = this.positionOf(cube, i);
        if (!this.isShown(camera, cube, i, at)) continue;
        found.push({ depth: isPerspective(camera) ? w : depth, off: Math.hypot(dx, dy), cube, i });
      }
    }
    if (found.length === 0) return null;
    const front = Math.min(...nearest(found, radius / 2).map((it) => it.depth));
    const slack = isPerspective(camera) ? 0.03 * front : 0.02;
    let best = found[0]!;
    let least = Number.POSITIVE_INFINITY;
    const confidences: number[] = [];
    for (const it of found) {
      if (it.depth > front + slack) continue;
      const confidence = (it.cube.points?.colors[4 * it.i + 3] ?? 0) / 255;
      confidences.push(confidence);
      const cost = it.off + 0.3 * radius * (1 - confidence);
      if (cost < least) {
        least = cost;
        best = it;
      }
    }
    // The most confident of many points is overestimated: limit it to the median confidence nearby.
    confidences.sort((a, b) => a - b);
    const usual = confidences[Math.floor(confidences.length / 2)] ?? 0;
    const point = this.pointOf(best.cube, best.i);
    if (point.keyframe < 0) point.keyframe = this.keyframeNear(point.position);
    return { ...point, confidence: Math.min(point.confidence, usual) };
  }

  /** Whether a point is neither cut away nor on a surface that is left out because it is seen from behind. */
  isShown(camera: Camera, cube: Cube, i: number, at: Vec3): boolean {
    const u = this.material.uniforms;
    const low = u["low"]!.value as Vector3;
    const high = u["high"]!.value as Vector3;
    const isCut = this.basis.some((axis, k) => {
      const along = dot(axis, at);
      return along < low.getComponent(k) || along > high.getComponent(k);
    });
    return !isCut && !(u["facing"]!.value === true && this.isFromBehind(camera, cube, i, at));
  }

  private isFromBehind(camera: Camera, cube: Cube, i: number, at: Vec3): boolean {
    const signed = (k: number): number => ((cube.points?.normalsAndViews[4 * i + k] ?? 0) << 24) >> 24;
    const normal = new Vector3(...normalFrom(signed(0), signed(1))).transformDirection(cube.matrix);
    const seen = isPerspective(camera)
      ? new Vector3(...at).sub(camera.position)
      : camera.getWorldDirection(new Vector3());
    return normal.dot(seen) > 0;
  }

  /** Of the nearest point that the page itself holds: others do not say which keyframe made them. */
  private keyframeNear(position: Vec3): number {
    let keyframe = -1;
    let least = Number.POSITIVE_INFINITY;
    for (const cube of this.cubes) {
      for (let i = 0; i < (cube.held?.count ?? 0); ++i) {
        const here = cube.held?.keyframes[i] ?? kNoKeyframe;
        const off = norm(sub(this.positionOf(cube, i, cube.held), position));
        if (here === kNoKeyframe || off >= least) continue;
        least = off;
        keyframe = here;
      }
    }
    return keyframe;
  }

  private positionOf(cube: Cube, i: number, points = cube.points): Vec3 {
    const at = (k: number): number => (points?.positions[4 * i + k] ?? 0) / 65535;
    const [x, y, z] = [at(0), at(1), at(2)];
    const e = cube.matrix.elements;
    const row = (r: number): number => e[r]! * x + e[r + 4]! * y + e[r + 8]! * z + e[r + 12]!;
    return [row(0), row(1), row(2)];
  }

  private pointOf(cube: Cube, i: number): Found {
    const keyframe = cube.points?.keyframes[i] ?? kNoKeyframe;
    return {
      position: this.positionOf(cube, i),
      confidence: (cube.points?.colors[4 * i + 3] ?? 0) / 255,
      keyframe: keyframe === kNoKeyframe ? -1 : keyframe,
    };
  }
}

/** Those within a radius, or all where there are none. */
function nearest<T extends { off: number }>(all: T[], radius: number): T[] {
  const some = all.filter((it) => it.off <= radius);
  return (some.length > 0 ? some : all).slice(0, 50_000);
}

/** Median point spacing, if surfaces are covered evenly. */
function usualSpacing(nodes: readonly { side: number; points: number }[]): number {
  const leaves = nodes.filter((n) => n.points > 0).map((n) => [n.side / Math.sqrt(n.points), n.points] as const);
  leaves.sort((a, b) => a[0] - b[0]);
  const half = leaves.reduce((sum, it) => sum + it[1], 0) / 2;
  let sum = 0;
  for (const [spacing, points] of leaves) {
    sum += points;
    if (sum >= half) return spacing;
  }
  return 0.01;
}

