// SPDX-License-Identifier: BSD-2-Clause
// Client of LiveServer (src/web/live_server.cpp): polls for changes, fetches new and replaced points by keyframe, and
// applies new poses.
import { Matrix4 } from "three";
import { kNoKeyframe, kPointBytes, type KeyframeData, type NodePoints, nodePoints } from "./data";
import { type Pose, type Vec3, add } from "./geometry";
import { Throttle } from "./throttle";
import type { Viewer } from "./viewer";

interface CloudChange {
  id: string;
  points_version: number;
  /** Row-major 3x4, page from keyframe, without `origin`. */
  matrix: number[];
}
interface Reply {
  page_version: number;
  version: number;
  state_version: number;
  reset: boolean;
  done: boolean;
  clouds: CloudChange[];
  removed: string[];
  /** Same for the current camera pose. */
  camera?: number[];
  trajectory?: { id: string; matrix: number[] }[];
  /** Number of points of the map; the page receives part of them. */
  total_points: number;
  stage?: string;
  /** Of the work, 0 to 1. */
  share?: number;
  seconds_left?: number;
  /** Given if they have changed. */
  landmarks?: { version: number; matrix: number[] };
  /** Keyframes with new photos. */
  photos: string[];
  newest_photo?: string;
  /** Address of the finished report. */
  report?: string;
}

interface LiveProgress {
  stage: string;
  /** null = unknown */
  share: number | null;
  secondsLeft: number | null;
}

export type LiveState = "waiting" | "running" | "done" | "disconnected";

const kCubeBytes = 32;
/** A point of a live block: kPointBytes without the keyframe index. */
const kLivePointBytes = kPointBytes - 2;
const kMaxRequests = 3;
const kUpdatePause = 100; // [ms]
const sleep = (ms: number): Promise<void> => new Promise((done) => setTimeout(done, ms));

interface LiveBlock {
  /** The cube around the points, in the frame of the keyframe. */
  corner: Vec3;
  side: number;
  points: NodePoints;
}

/** `keyframe`: index in ReportData.keyframes. */
export function liveBlock(bytes: Uint8Array<ArrayBuffer>, keyframe: number): LiveBlock {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const count = (bytes.length - kCubeBytes) / kLivePointBytes;
  if (!Number.isInteger(count) || count < 0) throw new Error(`a block of points has ${bytes.length} bytes`);
  const columns = new Uint8Array(kPointBytes * count);
  columns.set(bytes.subarray(kCubeBytes));
  const points = nodePoints(columns, count);
  points.keyframes.fill(Math.min(keyframe, kNoKeyframe));
  const number = (i: number): number => view.getFloat64(8 * i, true);
  return { corner: [number(0), number(1), number(2)], side: number(3), points };
}

/** Returns positions relative to the page's origin. */
export function landmarksOf(bytes: ArrayBuffer, matrix: readonly number[]): Vec3[] {
  if (bytes.byteLength % 12 !== 0) throw new Error(`landmarks have ${bytes.byteLength} bytes`);
  const view = new DataView(bytes);
  const m = (i: number): number => matrix[i] ?? 0;
  return Array.from({ length: bytes.byteLength / 12 }, (_, i): Vec3 => {
    const [x, y, z] = [0, 4, 8].map((k) => view.getFloat32(12 * i + k, true)) as [number, number, number];
    const row = (r: number): number => m(r) * x + m(r + 1) * y + m(r + 2) * z + m(r + 3);
    return [row(0), row(4), row(8)];
  });
}

/** Returns the pose of a keyframe; `origin` is added to its centre. */
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
  /** Time of the last points [performance.now()]. */
  lastPoints = 0;
  /** Number of blocks fetched. */
  fetched = 0;
  /** Identifies the page to the server, which at its end waits for all pages. */
  private readonly client = Math.floor(Math.random() * 2 ** 48);
  private since = 0;
  private stateVersion = 0;
  /** Matrices by keyframe id. Insertion order is the index in ReportData.keyframes, therefore entries are kept. */
  private readonly keyframes = new Map<string, { index: number; matrix: number[] }>();
  /** Version of the points shown, by keyframe id. */
  private readonly shown = new Map<string, number>();
  /** From the page's origin. */
  camera: Pose | null = null;
  landmarks: readonly Vec3[] = [];
  totalPoints = 0;
  progress: LiveProgress = { stage: "", share: null, secondsLeft: null };
  newestPhoto: { id: string; address: string } | null = null;
  report = "";
  /** Addresses by keyframe id. */
  private readonly photos = new Map<string, string>();
  /** Ranks and matrices by id of the trajectory; null = none received. */
  private trajectory: Map<string, { rank: number; matrix: number[] }> | null = null;
  private readonly updateLater = new Throttle(kUpdatePause, () => {
    this.showKeyframes();
    this.changed();
  });

  /** `changed`: called after each update. */
  constructor(
    private readonly viewer: Pick<Viewer, "cloud" | "data" | "setTrajectory">,
    private readonly pageVersion: number,
    private readonly changed: () => void,
  ) {}

  /** Polls until the map has ended. */
  async poll(): Promise<void> {
    this.changed();
    for (let failed = 0; this.state !== "done"; ) {
      try {
        const reply = await this.changes();
        if (reply.page_version !== this.pageVersion) {
          location.reload();
          return;
        }
        await this.apply(reply);
        failed = 0;
        this.state = reply.done ? "done" : this.shown.size > 0 ? "running" : "waiting";
      } catch (error) {
        console.warn("live map:", error);
        this.state = "disconnected";
        failed += 1;
      }
      this.changed();
      if (failed > 0) await sleep(Math.min(500 * failed, 5000));
    }
  }

  /** Whether another run is served at this address; to be called after the end. */
  async hasRestarted(): Promise<boolean> {
    const reply = await this.changes().catch(() => null);
    return reply !== null && reply.page_version !== this.pageVersion;
  }

  private async changes(): Promise<Reply> {
    const versions = `page_version=${this.pageVersion}&state_version=${this.stateVersion}&since=${this.since}`;
    const address = `live/changes?${versions}&client=${this.client}`;
    const reply = await fetch(address, { cache: "no-store", signal: AbortSignal.timeout(30_000) });
    if (!reply.ok) throw new Error(`no answer: ${reply.status}`);
    return (await reply.json()) as Reply;
  }

  private async apply(reply: Reply): Promise<void> {
    if (reply.reset) {
      for (const id of this.shown.keys()) this.viewer.cloud.remove(id);
      this.shown.clear();
      this.keyframes.clear();
    }
    if (reply.trajectory) this.setTrajectory(reply.trajectory);
    if (reply.camera) this.camera = poseOf(reply.camera, [0, 0, 0]);
    this.totalPoints = reply.total_points;
    this.progress = { stage: reply.stage ?? "", share: reply.share ?? null, secondsLeft: reply.seconds_left ?? null };
    this.report = reply.report ?? "";
    // A replaced photo has another address: the version.
    for (const id of reply.photos) this.photos.set(id, `live/photos/${id}?${reply.state_version}`);
    const newest = this.photos.get(reply.newest_photo ?? "");
    this.newestPhoto = newest ? { id: reply.newest_photo!, address: newest } : null;
    this.changed();
    if (reply.landmarks) await this.fetchLandmarks(reply.landmarks);
    for (const id of reply.removed) {
      this.viewer.cloud.remove(id);
      this.shown.delete(id);
      const pose = this.trajectory?.get(id);
      if (pose) this.setMatrix(id, pose.matrix);
    }
    const wanted: CloudChange[] = [];
    for (const it of reply.clouds) {
      this.setMatrix(it.id, it.matrix);
      if (this.shown.get(it.id) === it.points_version) this.viewer.cloud.move(it.id, matrixOf(it.matrix));
      else wanted.push(it);
    }
    if (wanted.length > 0) this.updateLater.request();
    const work = async (): Promise<void> => {
      for (let it = wanted.shift(); it; it = wanted.shift()) {
        await this.fetchPoints(it);
        this.updateLater.request();
      }
    };
    // All requests end before the next poll: a late one would restore outdated points.
    const results = await Promise.allSettled(Array.from({ length: kMaxRequests }, work));
    this.showKeyframes();
    for (const result of results) if (result.status === "rejected") throw result.reason;
    this.since = reply.version;
    this.stateVersion = reply.state_version;
  }

  private setTrajectory(poses: NonNullable<Reply["trajectory"]>): void {
    this.trajectory = poses.length > 0 ? new Map(poses.map(({ id, matrix }, rank) => [id, { rank, matrix }])) : null;
    for (const it of poses) if (!this.shown.has(it.id)) this.setMatrix(it.id, it.matrix);
  }

  private setMatrix(id: string, matrix: number[]): void {
    const known = this.keyframes.get(id);
    if (known) known.matrix = matrix;
    else this.keyframes.set(id, { index: this.keyframes.size, matrix });
  }

  private async fetchPoints(it: CloudChange): Promise<void> {
    const address = `live/points/${it.id}/${it.points_version}`;
    const reply = await fetch(address, { cache: "no-store", signal: AbortSignal.timeout(30_000) });
    if (reply.status === 204) return; // replaced meanwhile; the next reply contains the new version
    if (!reply.ok) throw new Error(`no points: ${reply.status}`);
    const bytes = new Uint8Array(await reply.arrayBuffer());
    const block = liveBlock(bytes, this.keyframes.get(it.id)?.index ?? kNoKeyframe);
    this.viewer.cloud.setKeyframePoints(it.id, matrixOf(it.matrix), block);
    this.shown.set(it.id, it.points_version);
    this.lastPoints = performance.now();
    this.fetched += 1;
  }

  private async fetchLandmarks(it: { version: number; matrix: number[] }): Promise<void> {
    const reply = await fetch(`live/landmarks/${it.version}`, { cache: "no-store", signal: AbortSignal.timeout(30_000) });
    if (reply.status === 404) return; // replaced meanwhile; the next reply contains the new version
    if (!reply.ok) throw new Error(`no landmarks: ${reply.status}`);
    this.landmarks = landmarksOf(await reply.arrayBuffer(), it.matrix);
    this.updateLater.request();
  }

  /** Centres of the keyframes with points, from the page's origin. */
  *eyes(): Generator<[string, Vec3]> {
    for (const [id, { matrix }] of this.keyframes) if (this.shown.has(id)) yield [id, [matrix[3]!, matrix[7]!, matrix[11]!]];
  }

  private showKeyframes(): void {
    const keyframes = [...this.keyframes].map(([id, { matrix }]): KeyframeData => {
      const photo = this.photos.get(id);
      const use = this.shown.has(id) ? "depth map" : "no points";
      return { id, use, ...(photo ? { photo } : {}), ...poseOf(matrix, this.viewer.data.origin) };
    });
    this.viewer.setTrajectory(keyframes, this.order(), this.camera?.center ?? null);
  }

  /** Returns the indices of existing keyframes in the order of the trajectory, others by id. */
  private order(): number[] {
    const rank = (id: string): number => this.trajectory?.get(id)?.rank ?? Number.MAX_SAFE_INTEGER;
    return [...this.keyframes]
      .filter(([id]) => this.shown.has(id) || this.trajectory?.has(id))
      .sort(([a], [b]) => rank(a) - rank(b) || Number(a) - Number(b))
      .map(([, { index }]) => index);
  }
}
