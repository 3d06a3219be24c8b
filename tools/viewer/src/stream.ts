// SPDX-License-Identifier: BSD-2-Clause
// The rest of the points, from the Potree folder beside a page that is served: of what is in view the cubes that look
// large, up to a budget; what is far or out of view goes where others need its place.
import { type Camera, Vector3 } from "three";
import type { Cloud, Cube } from "./cloud";
import type { Vec3 } from "./geometry";
import { type Potree, type PotreeNode, potreeFrom, potreePoints } from "./potree";
import { Sight } from "./sight";

interface Streamed {
  node: PotreeNode;
  cube: Cube;
  children: Streamed[];
  center: Vector3;
  radius: number;
  /** What the page itself holds of it. */
  held: number;
  isLoaded: boolean;
  asking: AbortController | null;
  /** When it was wanted last, in looks. */
  wanted: number;
}

const kMaxRequests = 6;
/** Cubes whose ball looks smaller than that add nothing that is seen [px]. */
const kSmallest = 100;
const kRetryAfter = 5000; // [ms]

export type StreamState = "opening" | "open" | "lost" | "refused";

export class Stream {
  state: StreamState = "opening";
  /** Why it was refused. */
  reason = "";
  /** Points in memory besides those that the page holds. */
  budget = 4_000_000;
  loadedPoints = 0;
  private tree: Potree | null = null;
  private all: Streamed[] = [];
  private looks = 0;
  private waitUntil = 0;
  private inFlight = 0;
  private lookAgain: () => void = () => {};

  /** `folder`: address, relative to the page. `changed`: there is more, or less, to draw. */
  constructor(
    private readonly cloud: Cloud,
    private readonly folder: string,
    private readonly origin: Vec3,
    private readonly changed: () => void,
  ) {}

  async open(): Promise<void> {
    try {
      const get = async (name: string): Promise<Response> => {
        const reply = await fetch(`${this.folder}/${name}`);
        if (!reply.ok) throw new Error(`${name}: ${reply.status}`);
        return reply;
      };
      const [metadata, hierarchy] = await Promise.all([get("metadata.json"), get("hierarchy.bin")]);
      const bytes = new Uint8Array(await hierarchy.arrayBuffer());
      this.tree = potreeFrom(await metadata.text(), bytes, this.origin);
      this.join(this.tree.root);
      this.state = "open";
    } catch (error) {
      this.state = "refused";
      this.reason = error instanceof Error ? error.message : String(error);
    }
    this.changed();
  }

  /** Cubes of the page are cubes of the octree, or it is of another cloud. */
  private join(root: PotreeNode): void {
    const key = (level: number, corner: Vec3, side: number): string =>
      `${level} ${corner.map((x, i) => Math.round((x - (root.corner[i] ?? 0)) / side)).join(" ")}`;
    const held = new Map<string, Cube>();
    for (const cube of this.cloud.cubes) held.set(key(cube.level, cube.corner, cube.side), cube);
    const found: Streamed[] = [];
    let matched = 0;
    const visit = (node: PotreeNode): Streamed => {
      const cube = held.get(key(node.level, node.corner, node.side));
      if (cube) {
        const isSame = Math.abs(cube.side - node.side) < 1e-6 * node.side && (cube.points?.count ?? 0) <= node.points;
        if (!isSame) throw new Error("it holds another cloud than this page");
        matched += 1;
      }
      const center = new Vector3(...node.corner).addScalar(node.side / 2);
      const radius = (node.side * Math.sqrt(3)) / 2;
      const count = cube?.points?.count ?? 0;
      const made: Streamed = {
        node,
        cube: cube ?? this.cloud.octreeCube(node.level, node.corner, node.side),
        children: [],
        center,
        radius,
        held: count,
        isLoaded: count === node.points,
        asking: null,
        wanted: 0,
      };
      found.push(made);
      made.children = node.children.map(visit);
      return made;
    };
    visit(root);
    if (matched !== held.size) throw new Error("it holds another cloud than this page");
    for (const it of found) if (!held.has(key(it.node.level, it.node.corner, it.node.side))) this.cloud.cubes.push(it.cube);
    this.all = found;
  }

  /** Whether nothing more comes for the view of the last call of look(). */
  get isIdle(): boolean {
    return this.state !== "opening" && this.inFlight === 0;
  }

  /** To be called after a frame. `focalLength`: of a unit at distance 1, or of a unit of a flat view [px]. */
  look(camera: Camera, focalLength: number): void {
    const root = this.all[0];
    this.lookAgain = () => this.look(camera, focalLength);
    if (!root || (this.state === "lost" && performance.now() < this.waitUntil)) return;
    this.looks += 1;
    const sight = new Sight(camera);
    const seen: [Streamed, number][] = [];
    const visit = (it: Streamed): void => {
      const size = sight.sizeOf(it.center, it.radius);
      if (size === 0 || (size * focalLength < kSmallest && it !== root)) return;
      seen.push([it, size]);
      it.children.forEach(visit);
    };
    visit(root);
    seen.sort((a, b) => b[1] - a[1]);
    const missing: Streamed[] = [];
    let sum = 0;
    for (const [it] of seen) {
      const more = it.node.points - it.held;
      if (sum + more > this.budget) break;
      sum += more;
      it.wanted = this.looks;
      if (!it.isLoaded && !it.asking) missing.push(it);
    }
    for (const it of this.all) if (it.asking && it.wanted !== this.looks) it.asking.abort();
    for (const it of missing.slice(0, kMaxRequests - this.inFlight)) void this.load(it);
    if (this.makeRoom()) this.changed();
  }

  private async load(it: Streamed): Promise<void> {
    const { node } = it;
    const asking = (it.asking = new AbortController());
    this.inFlight += 1;
    try {
      const range = `bytes=${node.first}-${node.first + node.bytes - 1}`;
      const reply = await fetch(`${this.folder}/octree.bin`, { headers: { Range: range }, signal: asking.signal });
      if (reply.status !== 206) throw new Error(`octree.bin: ${reply.status}`);
      const points = potreePoints(this.tree!, node, new Uint8Array(await reply.arrayBuffer()));
      this.cloud.exchange(it.cube, points);
      it.isLoaded = true;
      this.loadedPoints += node.points - it.held;
      this.state = "open";
      this.makeRoom();
    } catch {
      if (!asking.signal.aborted) {
        this.state = "lost";
        this.waitUntil = performance.now() + kRetryAfter;
        setTimeout(this.changed, kRetryAfter + 100);
      }
    }
    it.asking = null;
    this.inFlight -= 1;
    this.lookAgain();
    this.changed();
  }

  /** Those go first that were not wanted for longest, of these the smallest. Returns whether any went. */
  private makeRoom(): boolean {
    if (this.loadedPoints <= this.budget) return false;
    const idle = this.all.filter((it) => it.isLoaded && it.node.points > it.held && it.wanted !== this.looks);
    idle.sort((a, b) => a.wanted - b.wanted || b.node.level - a.node.level);
    let gone = 0;
    for (const it of idle) {
      if (this.loadedPoints <= this.budget) break;
      this.cloud.exchange(it.cube, null);
      it.isLoaded = false;
      this.loadedPoints -= it.node.points - it.held;
      gone += 1;
    }
    return gone > 0;
  }
}
