// SPDX-License-Identifier: BSD-2-Clause
// A run while it works: asks what has changed, fetches the points of keyframes that are new or have others than before,
// and moves those that have only moved. src/web/live_server.cpp is the other end.
import { Matrix4 } from "three";
import { kPointBytes, type KeyframeData, type NodePoints, nodePoints } from "./data";
import { type Pose, type Vec3, add } from "./geometry";
import type { Viewer } from "./viewer";

interface CloudChange {
  id: number;
  /** Version of its points. */
  since: number;
  /** To the page, 3 rows of 4. */
  matrix: number[];
}
interface Reply {
  epoch: number;
  version: number;
  news: number;
  reset: boolean;
  done: boolean;
  clouds: CloudChange[];
  removed: number[];
  /** Matrix, as of a keyframe. */
  camera?: number[];
  flight?: { id: number; matrix: number[] }[];
}

export type LiveState = "waiting" | "running" | "done" | "lost";

const kCubeBytes = 32;
/** Of a point: what a page that is a file holds, but for its keyframe. */
const kColumnBytes = kPointBytes - 2;
const kAtOnce = 3;
const sleep = (ms: number): Promise<void> => new Promise((done) => setTimeout(done, ms));

export interface LiveBlock {
  /** The cube around the points, in the frame of the keyframe. */
  corner: Vec3;
  side: number;
  points: NodePoints;
}

/** `keyframe`: its place among the page's. */
export function liveBlock(bytes: Uint8Array<ArrayBuffer>, keyframe: number): LiveBlock {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const count = (bytes.length - kCubeBytes) / kColumnBytes;
  if (!Number.isInteger(count) || count < 0) throw new Error(`a block of points has ${bytes.length} bytes`);
  const columns = new Uint8Array(kPointBytes * count);
  columns.set(bytes.subarray(kCubeBytes));
  const points = nodePoints(columns, count);
  points.keyframes.fill(keyframe);
  const number = (i: number): number => view.getFloat64(8 * i, true);
  return { corner: [number(0), number(1), number(2)], side: number(3), points };
}

/** Where a keyframe's camera stood, from its matrix. */
export function poseOf(matrix: readonly number[], origin: Vec3): { center: Vec3; rotation: number[] } {
  const m = (i: number): number => matrix[i] ?? 0;
  const scale = Math.hypot(m(0), m(4), m(8)) || 1;
  return {
    center: add([m(3), m(7), m(11)], origin),
    rotation: [0, 4, 8, 1, 5, 9, 2, 6, 10].map((i) => m(i) / scale),
  };
}

const matrixOf = (m: readonly number[]): Matrix4 =>
  new Matrix4().set(m[0]!, m[1]!, m[2]!, m[3]!, m[4]!, m[5]!, m[6]!, m[7]!, m[8]!, m[9]!, m[10]!, m[11]!, 0, 0, 0, 1);

export class Live {
  state: LiveState = "waiting";
  /** When the newest points came into the picture, as performance.now(). */
  lastPoints = 0;
  /** Keyframes whose points were fetched, each version counts. */
  fetched = 0;
  /** So that a run that ends knows who has been told. */
  private readonly client = Math.floor(Math.random() * 2 ** 48);
  private since = 0;
  private news = 0;
  /** Keyframes in the order in which they were told, and where they are. */
  private readonly matrices = new Map<number, number[]>();
  /** Version of the points that are shown. */
  private readonly shown = new Map<number, number>();
  /** From the page's origin. */
  camera: Pose | null = null;
  /** Those of the flight; null = it is not told. */
  private flight: Set<number> | null = null;

  /** `changed`: something is to be shown. */
  constructor(
    private readonly viewer: Viewer,
    private readonly epoch: number,
    private readonly changed: () => void,
  ) {}

  /** Until the run is done. */
  async follow(): Promise<void> {
    this.changed();
    for (let failed = 0; this.state !== "done"; ) {
      try {
        const reply = await this.ask();
        if (reply.epoch !== this.epoch) {
          location.reload();
          return;
        }
        await this.apply(reply);
        failed = 0;
        this.state = reply.done ? "done" : this.shown.size > 0 ? "running" : "waiting";
      } catch {
        this.state = "lost";
        failed += 1;
      }
      this.changed();
      if (failed > 0) await sleep(Math.min(500 * failed, 5000));
    }
  }

  private async ask(): Promise<Reply> {
    const query = `epoch=${this.epoch}&since=${this.since}&news=${this.news}&client=${this.client}`;
    const reply = await fetch(`live/changes?${query}`, { cache: "no-store", signal: AbortSignal.timeout(30_000) });
    if (!reply.ok) throw new Error(`no answer: ${reply.status}`);
    return (await reply.json()) as Reply;
  }

  private async apply(reply: Reply): Promise<void> {
    if (reply.reset) {
      for (const id of this.shown.keys()) this.viewer.cloud.remove(id);
      this.shown.clear();
      this.matrices.clear();
    }
    if (reply.flight && reply.flight.length > 0) this.flight = new Set(reply.flight.map((it) => it.id));
    for (const it of reply.flight ?? []) if (!this.shown.has(it.id)) this.matrices.set(it.id, it.matrix);
    if (reply.camera) this.camera = poseOf(reply.camera, [0, 0, 0]);
    for (const id of reply.removed) {
      this.viewer.cloud.remove(id);
      this.shown.delete(id);
    }
    const wanted: CloudChange[] = [];
    for (const it of reply.clouds) {
      this.matrices.set(it.id, it.matrix);
      if (this.shown.get(it.id) === it.since) this.viewer.cloud.move(it.id, matrixOf(it.matrix));
      else wanted.push(it);
    }
    this.show();
    const work = async (): Promise<void> => {
      for (let it = wanted.shift(); it; it = wanted.shift()) {
        await this.fetchPoints(it);
        this.show();
        this.changed();
      }
    };
    await Promise.all(Array.from({ length: kAtOnce }, work));
    this.since = reply.version;
    this.news = reply.news;
  }

  private async fetchPoints(it: CloudChange): Promise<void> {
    const reply = await fetch(`live/points/${it.id}/${it.since}`, { cache: "no-store", signal: AbortSignal.timeout(30_000) });
    if (reply.status === 204) return; // there are newer ones, which the next answer tells
    if (!reply.ok) throw new Error(`no points: ${reply.status}`);
    const bytes = new Uint8Array(await reply.arrayBuffer());
    const place = [...this.matrices.keys()].indexOf(it.id);
    this.viewer.cloud.hang(it.id, matrixOf(it.matrix), liveBlock(bytes, place));
    this.shown.set(it.id, it.since);
    this.lastPoints = performance.now();
    this.fetched += 1;
  }

  private show(): void {
    const keyframes = [...this.matrices].map(([id, matrix]): KeyframeData => {
      const use = this.shown.has(id) ? "depth map" : this.flight?.has(id) ? "no points yet" : "gone";
      return { id, use, ...poseOf(matrix, this.viewer.data.origin) };
    });
    this.viewer.showFlight(keyframes, this.camera?.center ?? null);
  }
}
