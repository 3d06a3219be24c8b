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
  type PerspectiveCamera,
  Points,
  RawShaderMaterial,
  GLSL3,
  NoColorSpace,
  Vector2,
  Vector3,
  Vector4,
} from "three";
import { type NodeData, type NodePoints, kNoKeyframe } from "./data";
import { type Vec3, normalFrom } from "./geometry";
import type { Picked } from "./measure";
import { type PaletteName, paletteBytes } from "./palette";
import { fragmentShader, vertexShader } from "./shaders";
import { type Coloring, colorings } from "./state";

interface Cube {
  /** From the cube with corners 0 and 1 to the keyframe that it hangs on, or else to the page. */
  local: Matrix4;
  /** To the page. */
  matrix: Matrix4;
  side: number;
  center: Vector3;
  /** Of the ball around it. */
  radius: number;
  points: NodePoints | null;
  drawn: Points | null;
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
  /** Those that hang on a keyframe, by its id. */
  private readonly hung = new Map<number, Cube>();
  loaded = 0;
  /** Points that may be drawn at a time. */
  budget = 3_000_000;
  drawnPoints = 0;
  /** In the axes of the plan: what is there, but for the outermost 0.5 % of the points on each side. */
  low: Vec3 = [-1, -1, -1];
  high: Vec3 = [1, 1, 1];
  private readonly palettes = { viridis: texture("viridis"), cividis: texture("cividis") };
  private readonly material: RawShaderMaterial;

  constructor(
    nodes: readonly NodeData[],
    readonly basis: readonly [Vec3, Vec3, Vec3],
  ) {
    this.cubes = nodes.map((node) => newCube(node.corner, node.side));
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
        pixels: { value: 1000 },
        most: { value: 24 },
        palette: { value: this.palettes.viridis },
      },
    });
    this.spacing = usualSpacing(nodes);
  }

  private spacing: number;

  /** Takes the points of a cube. */
  fill(which: number, points: NodePoints): void {
    const cube = this.cubes[which];
    if (cube) this.attach(cube, points);
  }

  /** Hangs points on a keyframe in place of those that it has. `page`: from the keyframe's frame to the page. */
  hang(id: number, page: Matrix4, block: { corner: Vec3; side: number; points: NodePoints }): void {
    this.remove(id);
    const cube = newCube(block.corner, block.side);
    this.hung.set(id, cube);
    this.cubes.push(cube);
    this.attach(cube, block.points);
    this.move(id, page);
    this.spacing = usualSpacing(this.cubes.map((it) => ({ side: it.side / 2, points: it.points?.count ?? 0 })));
  }

  /** Moves a keyframe with what hangs on it. */
  move(id: number, page: Matrix4): void {
    const cube = this.hung.get(id);
    if (!cube) return;
    cube.matrix.multiplyMatrices(page, cube.local);
    cube.center.set(0.5, 0.5, 0.5).applyMatrix4(cube.matrix);
    cube.side = cube.matrix.getMaxScaleOnAxis();
    cube.radius = (cube.side * Math.sqrt(3)) / 2;
    cube.drawn?.matrix.copy(cube.matrix);
    if (cube.drawn) cube.drawn.matrixWorldNeedsUpdate = true;
  }

  remove(id: number): void {
    const cube = this.hung.get(id);
    if (!cube) return;
    this.hung.delete(id);
    this.cubes = this.cubes.filter((it) => it !== cube);
    this.loaded -= cube.points?.count ?? 0;
    if (!cube.drawn) return;
    this.group.remove(cube.drawn);
    cube.drawn.geometry.dispose();
  }

  private attach(cube: Cube, points: NodePoints): void {
    cube.points = points;
    this.loaded += points.count;
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(points.places, 4, true));
    geometry.setAttribute("rgbc", new BufferAttribute(points.colors, 4, true));
    geometry.setAttribute("look", new BufferAttribute(points.looks, 4, true));
    const drawn = new Points(geometry, this.material);
    drawn.frustumCulled = false;
    drawn.matrixAutoUpdate = false;
    drawn.matrix.copy(cube.matrix);
    cube.drawn = drawn;
    this.group.add(drawn);
  }

  /** Looks at every so many points for `low` and `high`. */
  measureExtent(): void {
    const places: [number[], number[], number[]] = [[], [], []];
    const stride = Math.max(1, Math.floor(this.loaded / 100_000));
    this.forEach(stride, (x, y, z) => {
      this.basis.forEach((axis, i) => places[i]?.push(axis[0] * x + axis[1] * y + axis[2] * z));
    });
    if (places[0].length === 0) return;
    const at = (i: 0 | 1 | 2, share: number): number => places[i][Math.floor(share * (places[i].length - 1))] ?? 0;
    for (const list of places) list.sort((a, b) => a - b);
    this.low = [at(0, 0.005), at(1, 0.005), at(2, 0.005)];
    this.high = [at(0, 0.995), at(1, 0.995), at(2, 0.995)];
  }

  private forEach(stride: number, visit: (x: number, y: number, z: number) => void): void {
    let number = 0;
    for (const cube of this.cubes) {
      for (let i = 0; i < (cube.points?.count ?? 0); ++i) {
        if (number++ % stride === 0) visit(...this.placeOf(cube, i));
      }
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
    u["size"]!.value = 1.6 * size * this.spacing;
    u["palette"]!.value = this.palettes[paletteOf(coloring) ?? "viridis"];
  }

  /** Which cubes are drawn: those that look largest, as far as the budget goes. `pixels`: of a unit at a distance of 1. */
  choose(camera: Camera, pixels: number, ratio: number): void {
    this.material.uniforms["pixels"]!.value = pixels;
    this.material.uniforms["most"]!.value = 28 * ratio;
    const matrix = new Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
    const eye = new Vector3().setFromMatrixPosition(camera.matrixWorld);
    const isFlat = !(camera as PerspectiveCamera).isPerspectiveCamera;
    const planes = frustumPlanes(matrix);
    const visible: [Cube, number][] = [];
    for (const cube of this.cubes) {
      if (!cube.drawn) continue;
      cube.drawn.visible = false;
      if (planes.some((p) => p.x * cube.center.x + p.y * cube.center.y + p.z * cube.center.z + p.w < -cube.radius)) {
        continue;
      }
      const distance = isFlat ? 1 : Math.max(cube.center.distanceTo(eye) - cube.radius, 0.02 * cube.radius);
      visible.push([cube, cube.radius / distance]);
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
  pick(camera: Camera, x: number, y: number, width: number, height: number, radius: number): Picked | null {
    const m = new Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
    const u = this.material.uniforms;
    const low = u["low"]!.value as Vector3;
    const high = u["high"]!.value as Vector3;
    const found: { depth: number; off: number; cube: Cube; i: number }[] = [];
    for (const cube of this.cubes) {
      const points = cube.points;
      if (!points) continue;
      const step = new Matrix4().makeScale(1 / 65535, 1 / 65535, 1 / 65535);
      const e = step.premultiply(cube.matrix).premultiply(m).elements;
      const [e0, e1, e3, e4, e5, e7] = [e[0]!, e[1]!, e[3]!, e[4]!, e[5]!, e[7]!];
      const [e8, e9, e11, e12, e13, e15] = [e[8]!, e[9]!, e[11]!, e[12]!, e[13]!, e[15]!];
      const places = points.places;
      for (let i = 0; i < points.count; ++i) {
        const px = places[4 * i]!;
        const py = places[4 * i + 1]!;
        const pz = places[4 * i + 2]!;
        const w = e3 * px + e7 * py + e11 * pz + e15;
        if (w <= 1e-9) continue;
        const dx = ((e0 * px + e4 * py + e8 * pz + e12) / w + 1) * 0.5 * width - x;
        if (dx > radius || dx < -radius) continue;
        const dy = (1 - (e1 * px + e5 * py + e9 * pz + e13) / w) * 0.5 * height - y;
        if (dx * dx + dy * dy > radius * radius) continue;
        const depth = e[2]! * px + e[6]! * py + e[10]! * pz + e[14]!;
        const at = this.placeOf(cube, i);
        const inPlan = this.basis.map((axis) => axis[0] * at[0] + axis[1] * at[1] + axis[2] * at[2]);
        if (inPlan.some((v, k) => v < low.getComponent(k) || v > high.getComponent(k))) continue;
        if (u["facing"]!.value === true && this.isFromBehind(camera, cube, i, at)) continue;
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
    // Who takes the surest of many must not take its word: it is as sure as those around it.
    confidences.sort((a, b) => a - b);
    const usual = confidences[Math.floor(confidences.length / 2)] ?? 0;
    const point = this.pointOf(best.cube, best.i);
    return { ...point, confidence: Math.min(point.confidence, usual) };
  }

  private isFromBehind(camera: Camera, cube: Cube, i: number, at: Vec3): boolean {
    const signed = (k: number): number => ((cube.points?.looks[4 * i + k] ?? 0) << 24) >> 24;
    const normal = new Vector3(...normalFrom(signed(0), signed(1))).transformDirection(cube.matrix);
    const seen = isPerspective(camera)
      ? new Vector3(...at).sub(camera.position)
      : camera.getWorldDirection(new Vector3());
    return normal.dot(seen) > 0;
  }

  private placeOf(cube: Cube, i: number): Vec3 {
    const at = (k: number): number => (cube.points?.places[4 * i + k] ?? 0) / 65535;
    const [x, y, z] = [at(0), at(1), at(2)];
    const e = cube.matrix.elements;
    const row = (r: number): number => e[r]! * x + e[r + 4]! * y + e[r + 8]! * z + e[r + 12]!;
    return [row(0), row(1), row(2)];
  }

  private pointOf(cube: Cube, i: number): Picked {
    const keyframe = cube.points?.keyframes[i] ?? kNoKeyframe;
    return {
      position: this.placeOf(cube, i),
      confidence: (cube.points?.colors[4 * i + 3] ?? 0) / 255,
      keyframe: keyframe === kNoKeyframe ? -1 : keyframe,
    };
  }
}

function newCube(corner: Vec3, side: number): Cube {
  const local = new Matrix4().makeTranslation(...corner).scale(new Vector3(side, side, side));
  return {
    local,
    matrix: local.clone(),
    side,
    center: new Vector3(...corner).addScalar(side / 2),
    radius: (side * Math.sqrt(3)) / 2,
    points: null,
    drawn: null,
  };
}

const isPerspective = (camera: Camera): boolean => (camera as PerspectiveCamera).isPerspectiveCamera === true;

/** Those within a radius, or all where there are none. */
function nearest<T extends { off: number }>(all: T[], radius: number): T[] {
  const some = all.filter((it) => it.off <= radius);
  return (some.length > 0 ? some : all).slice(0, 50_000);
}

function frustumPlanes(matrix: Matrix4): Vector4[] {
  const e = matrix.elements;
  const row = (i: number): Vector4 => new Vector4(e[i], e[i + 4], e[i + 8], e[i + 12]);
  const w = row(3);
  return [0, 1, 2].flatMap((i) =>
    [w.clone().add(row(i)), w.clone().sub(row(i))].map((p) => p.divideScalar(Math.hypot(p.x, p.y, p.z) || 1)),
  );
}

/** Half of the points have a neighbour that is nearer, if they cover surfaces evenly. */
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

