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
import type { Cut } from "./cuts";
import type { NodeData, NodePoints } from "./data";
import { angularSpacing, Detail, type DetailNode } from "./detail";
import { busyBox } from "./framing";
import { type Vec3, dot, normalFrom } from "./geometry";
import { type PaletteName, paletteBytes } from "./palette";
import { fragmentShader, vertexShader } from "./shaders";
import { isPerspective, Sight } from "./sight";
import { type Coloring, colorings } from "./state";

/** Diameter of points as drawn, in spacings. */
const kOverlap = 1.6;

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
  /** Of the octree; null = of a keyframe. */
  node: DetailNode | null;
  /** Of a keyframe: its camera in the unit cube, and the points' spacing at distance 1. */
  eye: Vector3;
  angularSpacing: number;
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
  readonly keyframeCubes = new Map<string, Cube>();
  loaded = 0;
  /** Robust bounds along `basis` (framing.ts). */
  low: Vec3 = [-1, -1, -1];
  high: Vec3 = [1, 1, 1];
  private readonly palettes = { viridis: texture("viridis"), cividis: texture("cividis") };
  private readonly material: RawShaderMaterial;

  constructor(
    nodes: readonly NodeData[],
    readonly basis: readonly [Vec3, Vec3, Vec3],
    hasNormals = true,
  ) {
    this.cubes = nodes.map((node) => this.octreeCube(node.level, node.corner, node.side));
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
        hasNormals: { value: hasNormals },
        size: { value: 1.6 },
        spacing: { value: 0 },
        eyeOfCube: { value: new Vector3() },
        nodes: { value: this.detail.texture },
        node: { value: -1 },
        focalLength: { value: 1000 },
        minPointSize: { value: 2 },
        maxPointSize: { value: 24 },
        palette: { value: this.palettes.viridis },
      },
    });
  }

  private readonly detail = new Detail();

  /** A cube of the octree, without points. */
  octreeCube(level: number, corner: Vec3, side: number): Cube {
    const made = this.newCube(level, corner, side);
    made.node = this.detail.nodeOf(level, corner, side);
    return made;
  }

  private newCube(level: number, corner: Vec3, side: number): Cube {
    const local = new Matrix4().makeTranslation(...corner).scale(new Vector3(side, side, side));
    const center = new Vector3(...corner).addScalar(side / 2);
    const radius = (side * Math.sqrt(3)) / 2;
    return { level, corner, local, matrix: local.clone(), side, center, radius, points: null, held: null, drawn: null, node: null, eye: new Vector3(), angularSpacing: 0 };
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
    cube.eye.set(...block.corner).multiplyScalar(-1 / block.side);
    cube.angularSpacing = angularSpacing(block.points, cube.eye.toArray() as [number, number, number]);
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
    if (cube.node) Detail.setPoints(cube.node, null);
    if (!cube.drawn) return;
    this.group.remove(cube.drawn);
    cube.drawn.geometry.dispose();
    cube.drawn = null;
  }

  private attach(cube: Cube, points: NodePoints): void {
    cube.points = points;
    this.loaded += points.count;
    if (cube.node) Detail.setPoints(cube.node, points);
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(points.positions, 4, true));
    geometry.setAttribute("rgbc", new BufferAttribute(points.colors, 4, true));
    geometry.setAttribute("normal_views", new BufferAttribute(points.normalsAndViews, 4, true));
    const drawn = new Points(geometry, this.material);
    drawn.frustumCulled = false;
    drawn.matrixAutoUpdate = false;
    drawn.matrix.copy(cube.matrix);
    drawn.onBeforeRender = () => {
      const u = this.material.uniforms;
      u["node"]!.value = cube.node?.index ?? -1;
      u["spacing"]!.value = cube.side * cube.angularSpacing;
      u["eyeOfCube"]!.value = cube.eye;
      this.material.uniformsNeedUpdate = true;
    };
    cube.drawn = drawn;
    this.group.add(drawn);
  }

  /** Looks at every so many points for `low` and `high`. `path`: of the camera, which is in it. `more`: other points. */
  measureExtent(path: readonly Vec3[] = [], more: readonly Vec3[] = []): void {
    const inPlan = (p: Vec3): Vec3 => [dot(this.basis[0], p), dot(this.basis[1], p), dot(this.basis[2], p)];
    const points: Vec3[] = more.map(inPlan);
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

  /** Calls `visit` for every so many points that a camera may see, those of surfaces that face it. */
  forEachShown(camera: Camera, stride: number, visit: (at: Vec3) => void): void {
    let number = 0;
    for (const cube of this.cubes) {
      for (let i = 0; i < (cube.points?.count ?? 0); ++i) {
        if (number++ % stride !== 0) continue;
        const at = this.positionOf(cube, i);
        if (this.isShown(camera, cube, i, at)) visit(at);
      }
    }
  }

  /** Returns heights along `basis` of surfaces that face up, of every so many points. */
  floorHeights(stride: number): number[] {
    const heights: number[] = [];
    let number = 0;
    for (const cube of this.cubes) {
      for (let i = 0; i < (cube.points?.count ?? 0); ++i) {
        if (number++ % stride !== 0 || dot(this.normalOf(cube, i).toArray(), this.basis[2]) < 0.9) continue;
        heights.push(dot(this.positionOf(cube, i), this.basis[2]));
      }
    }
    return heights;
  }

  private normalOf(cube: Cube, i: number): Vector3 {
    const signed = (k: number): number => ((cube.points?.normalsAndViews[4 * i + k] ?? 0) << 24) >> 24;
    return new Vector3(...normalFrom(signed(0), signed(1))).transformDirection(cube.matrix);
  }

  /** Every so many points of a cube; number by number, since there may be millions. */
  visit(cube: Cube, visit: (x: number, y: number, z: number, i: number) => void, stride = 1): void {
    const [xx, xy, xz, , yx, yy, yz, , zx, zy, zz, , x0, y0, z0] = cube.matrix.elements;
    const positions = cube.points?.positions ?? [];
    for (let i = 0; i < (cube.points?.count ?? 0); i += stride) {
      const a = positions[4 * i]! / 65535;
      const b = positions[4 * i + 1]! / 65535;
      const c = positions[4 * i + 2]! / 65535;
      visit(xx * a + yx * b + zx * c + x0, xy * a + yy * b + zy * c + y0, xz * a + yz * b + zz * c + z0, i);
    }
  }

  /** `facing`: only surfaces seen from the front. */
  setLook(coloring: Coloring, size: number, cut: Cut, facing: boolean): void {
    const u = this.material.uniforms;
    const corner = (end: 0 | 1): Vector3 => {
      const at = [0, 1, 2].map((i) => cut[2 * i + end] ?? (end === 0 ? -1e30 : 1e30));
      return new Vector3(at[0], at[1], at[2]);
    };
    u["low"]!.value = corner(0);
    u["high"]!.value = corner(1);
    u["heights"]!.value = new Vector2(this.low[2], this.high[2]);
    u["facing"]!.value = facing;
    u["coloring"]!.value = colorings.indexOf(coloring);
    u["size"]!.value = kOverlap * size;
    u["palette"]!.value = this.palettes[paletteOf(coloring) ?? "viridis"];
  }

  /**
   * Returns the cubes in view, those that look largest first, `budget` points at most, and whether these are all.
   * `focalLength`: of a unit at distance 1, or of a unit of a flat view [px].
   */
  choose(camera: Camera, focalLength: number, ratio: number, budget: number): { cubes: Cube[]; isAll: boolean } {
    const u = this.material.uniforms;
    u["focalLength"]!.value = focalLength;
    u["minPointSize"]!.value = 1.5 * ratio;
    u["maxPointSize"]!.value = 32 * ratio;
    const sight = new Sight(camera);
    const visible: [Cube, number][] = [];
    for (const cube of this.cubes) {
      if (!cube.drawn) continue;
      const size = sight.sizeOf(cube.center, cube.radius);
      if (size > 0) visible.push([cube, size]);
    }
    visible.sort((a, b) => b[1] - a[1]);
    const chosen: Cube[] = [];
    let sum = 0;
    for (const [cube] of visible) {
      sum += cube.points?.count ?? 0;
      if (sum > budget && chosen.length > 0) break;
      chosen.push(cube);
    }
    this.detail.show(chosen.flatMap((cube) => cube.node ?? []));
    u["nodes"]!.value = this.detail.texture;
    return { cubes: chosen, isAll: chosen.length === visible.length };
  }

  /** Only these are drawn next. */
  show(cubes: readonly Cube[]): void {
    for (const cube of this.cubes) if (cube.drawn) cube.drawn.visible = false;
    for (const cube of cubes) if (cube.drawn) cube.drawn.visible = true;
  }

  /** Whether a place is cut away. */
  isCut(at: Vec3): boolean {
    const u = this.material.uniforms;
    const low = u["low"]!.value as Vector3;
    const high = u["high"]!.value as Vector3;
    return this.basis.some((axis, k) => {
      const along = dot(axis, at);
      return along < low.getComponent(k) || along > high.getComponent(k);
    });
  }

  /** Whether a point is neither cut away nor on a surface that is left out because it is seen from behind. */
  isShown(camera: Camera, cube: Cube, i: number, at: Vec3): boolean {
    return !this.isCut(at) && !(this.material.uniforms["facing"]!.value === true && this.isFromBehind(camera, cube, i, at));
  }

  private isFromBehind(camera: Camera, cube: Cube, i: number, at: Vec3): boolean {
    const normal = this.normalOf(cube, i);
    const seen = isPerspective(camera)
      ? new Vector3(...at).sub(camera.position)
      : camera.getWorldDirection(new Vector3());
    return normal.dot(seen) > 0;
  }

  positionOf(cube: Cube, i: number, points = cube.points): Vec3 {
    const at = (k: number): number => (points?.positions[4 * i + k] ?? 0) / 65535;
    const [x, y, z] = [at(0), at(1), at(2)];
    const e = cube.matrix.elements;
    const row = (r: number): number => e[r]! * x + e[r + 4]! * y + e[r + 8]! * z + e[r + 12]!;
    return [row(0), row(1), row(2)];
  }
}
