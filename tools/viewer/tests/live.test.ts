// SPDX-License-Identifier: BSD-2-Clause
import assert from "node:assert/strict";
import { test } from "node:test";
import { kNoKeyframe } from "../src/data";
import { landmarksOf, Live, liveBlock, poseOf } from "../src/live";
import { durationText } from "../src/live_page";
import { nearestKeyframe, pathOf, stepFrom } from "../src/trajectory";

test("a keyframe's block has a cube and points", () => {
  const bytes = new Uint8Array(32 + 13 * 2);
  const view = new DataView(bytes.buffer);
  [1, 2, 3, 8].forEach((value, i) => view.setFloat64(8 * i, value, true));
  view.setUint16(32 + 6, 65535, true); // x of the second point
  bytes[32 + 12 + 3] = 200; // its red
  bytes[32 + 18 + 1] = 128; // its confidence
  const block = liveBlock(bytes, 7);
  assert.deepEqual(block.corner, [1, 2, 3]);
  assert.equal(block.side, 8);
  assert.equal(block.points.count, 2);
  assert.equal(block.points.positions[4], 65535);
  assert.equal(block.points.colors[4], 200);
  assert.equal(block.points.colors[7], 128);
  assert.deepEqual([...block.points.keyframes], [7, 7]);
  assert.equal(liveBlock(bytes, 70_000).points.keyframes[0], kNoKeyframe);
  assert.throws(() => liveBlock(bytes.subarray(0, 40), 0), /40 bytes/);
  assert.throws(() => liveBlock(bytes.subarray(0, 16), 0), /16 bytes/);
});

test("a keyframe's pose follows from its matrix", () => {
  // Turned by a right angle about y, twice as large, at 1 2 3.
  const pose = poseOf([0, 0, 2, 1, 0, 2, 0, 2, -2, 0, 0, 3], [10, 0, 0]);
  assert.deepEqual(pose.center, [11, 2, 3]);
  assert.deepEqual(pose.rotation.map((x) => x + 0), [0, 0, -1, 0, 1, 0, 1, 0, 0]);
});

test("landmarks are turned, scaled and moved", () => {
  const bytes = new Float32Array([1, 2, 3, 0, 0, 0]).buffer;
  assert.deepEqual(landmarksOf(bytes, [0, -2, 0, 10, 2, 0, 0, 20, 0, 0, 2, 30]), [
    [6, 22, 36],
    [10, 20, 30],
  ]);
  assert.throws(() => landmarksOf(bytes.slice(0, 16), []), /16 bytes/);
});

test("durations have two units at most", () => {
  assert.deepEqual([-1, 59.4, 65, 3605, 7260].map(durationText), ["0 s", "59 s", "1 min 05 s", "1 h 00 min", "2 h 01 min"]);
});

/** Address of a request; what comes back. */
type Server = (address: string) => Promise<Response> | Response;

interface Shown {
  id: number | string;
  use: string;
}

/** Shows a live map that `server` serves until it is done; returns the keyframes in order, after each update. */
async function played(
  server: Server,
  changed: (live: Live) => void = () => {},
): Promise<{ orders: Shown[][]; points: Set<string>; keyframes: Shown[] }> {
  const orders: Shown[][] = [];
  const points = new Set<string>();
  let keyframes: Shown[] = [];
  const viewer = {
    data: { origin: [0, 0, 0] },
    cloud: {
      setKeyframePoints: (id: string) => points.add(id),
      move: () => {},
      remove: (id: string) => points.delete(id),
    },
    setTrajectory: (all: Shown[], order: number[]) => {
      keyframes = all;
      orders.push(order.map((i) => all[i]!));
    },
  };
  const { fetch } = globalThis;
  globalThis.fetch = async (address) => server(String(address));
  try {
    const live: Live = new Live(viewer as unknown as ConstructorParameters<typeof Live>[0], 1, () => changed(live));
    await live.poll();
  } finally {
    globalThis.fetch = fetch;
  }
  return { orders, points, keyframes };
}

const matrix = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];
const reply = (version: number, more: object): Response => {
  const unchanged = { page_version: 1, version, state_version: 1, reset: false, done: false, clouds: [], removed: [], photos: [], total_points: 0 };
  return new Response(JSON.stringify({ ...unchanged, ...more }));
};
const block = (): Response => new Response(new Uint8Array(32));
const cloudOf = (id: string): object => ({ id, points_version: 1, matrix });
const poses = (...ids: string[]): object[] => ids.map((id) => ({ id, matrix }));

test("landmarks, photo and progress are there before the points", async () => {
  const seen: unknown[] = [];
  const news = {
    total_points: 9,
    stage: "densify",
    share: 0.25,
    seconds_left: 90,
    landmarks: { version: 4, matrix },
    photos: ["3", "7"],
    newest_photo: "3",
    trajectory: poses("3"),
    clouds: [cloudOf("3")],
  };
  const replies = [reply(1, news), reply(2, { photos: ["7"], newest_photo: "7", report: "report/a.html", done: true })];
  const { keyframes } = await played(
    (address) => {
      if (address.startsWith("live/changes")) return replies.shift()!;
      seen.push(address);
      return address === "live/landmarks/4" ? new Response(new Float32Array([1, 2, 3])) : block();
    },
    ({ newestPhoto, totalPoints, progress, report }) => seen.push([newestPhoto?.address, totalPoints, progress.share, progress.secondsLeft, report]),
  );
  const first = ["live/photos/3?1", 9, 0.25, 90, ""];
  assert.deepEqual(seen.slice(1, 4), [first, "live/landmarks/4", "live/points/3/1"]);
  assert.deepEqual(seen.at(-1), ["live/photos/7?1", 0, null, null, "report/a.html"]);
  assert.equal((keyframes[0] as { photo?: string }).photo, "live/photos/3?1");
});

test("a run that follows at the same address is noticed after the end", async () => {
  let live: Live | null = null;
  let version = 1;
  const server = (): Response => reply(1, { done: true, page_version: version });
  await played(server, (it) => (live = it));
  const { fetch } = globalThis;
  try {
    globalThis.fetch = async () => server();
    assert.equal(await live!.hasRestarted(), false);
    version = 2;
    assert.equal(await live!.hasRestarted(), true);
    globalThis.fetch = async () => Promise.reject(new TypeError("no connection"));
    assert.equal(await live!.hasRestarted(), false);
  } finally {
    globalThis.fetch = fetch;
  }
});

test("requests for points end before the next poll, also if one of them fails", async (context) => {
  context.mock.method(console, "warn", () => {});
  const log: string[] = [];
  await played(async (address) => {
    if (address.startsWith("live/changes")) {
      log.push("poll");
      return log.length === 1 ? reply(1, { clouds: [cloudOf("1"), cloudOf("2")] }) : reply(2, { done: true });
    }
    if (address === "live/points/1/1") return new Response(null, { status: 500 });
    await new Promise((done) => setTimeout(done, 1000));
    log.push("points");
    return block();
  });
  assert.deepEqual(log, ["poll", "points", "poll"]);
});

test("keyframes follow the trajectory, not the arrival of their points, and keep their indices", async () => {
  const last = "9007199254740993"; // 2^53 + 1
  const replies = [
    reply(1, { clouds: [cloudOf("3")] }),
    reply(2, { trajectory: poses("1", "2", "3", last), clouds: [cloudOf(last), cloudOf("2")] }),
    reply(3, { removed: ["3"], trajectory: poses("1", "2", last), done: true }),
  ];
  const { orders, keyframes, points } = await played((address) =>
    address.startsWith("live/changes") ? replies.shift()! : block(),
  );
  const shown = (order: Shown[] | undefined): string[] => (order ?? []).map((it) => `${it.id}: ${it.use}`);
  assert.deepEqual(shown(orders[0]), ["3: depth map"]);
  assert.deepEqual(shown(orders[1]), ["1: no points", "2: depth map", "3: depth map", `${last}: depth map`]);
  assert.deepEqual(shown(orders.at(-1)), ["1: no points", "2: depth map", `${last}: depth map`]);
  assert.deepEqual(keyframes.map((it) => it.id), ["3", "1", "2", last]);
  assert.deepEqual([...points], [last, "2"]);
});

test("without a trajectory only keyframes with points exist, by id", async () => {
  const replies = [
    reply(1, { trajectory: poses("1", "2", "3"), clouds: [cloudOf("10")] }),
    reply(2, { trajectory: [], clouds: [cloudOf("9")], done: true }),
  ];
  const { orders } = await played((address) => (address.startsWith("live/changes") ? replies.shift()! : block()));
  assert.deepEqual(orders.at(-1)?.map((it) => it.id), ["9", "10"]);
});

test("a reset removes all keyframes but those of its trajectory", async () => {
  const replies = [
    reply(1, { trajectory: poses("1", "2"), clouds: [cloudOf("1"), cloudOf("2")] }),
    reply(2, { reset: true, trajectory: poses("1", "2"), clouds: [cloudOf("2")], done: true }),
  ];
  const { orders, points } = await played((address) =>
    address.startsWith("live/changes") ? replies.shift()! : block(),
  );
  assert.deepEqual(orders.at(-1)?.map((it) => `${it.id}: ${it.use}`), ["1: no points", "2: depth map"]);
  assert.deepEqual([...points], ["2"]);
});

test("the nearest keyframe is that of the trajectory, not of the indices", () => {
  const pose = { center: [0, 0, 0] as [number, number, number], rotation: [] };
  const keyframes = ["depth map", "no points", "depth map", "depth map"].map((use, id) => ({ id, use, ...pose }));
  assert.deepEqual(pathOf(keyframes, [2, 1, 0]), [2, 0]);
  assert.deepEqual(pathOf(keyframes, [1]), [1]);
  assert.equal(nearestKeyframe(keyframes, [3, 1, 0, 2], 1, true), 3);
  assert.equal(nearestKeyframe(keyframes, [0, 1, 2, 3], 9, false), 3);
});

test("steps go on from keyframes without a depth map, and from one end to the other", () => {
  const step = (from: number, by: number): number | undefined => stepFrom([4, 3, 0, 1, 2], [4, 0, 2], from, by);
  assert.deepEqual([1, 0, 2, 9].map((from) => step(from, 1)), [2, 2, 4, 4]);
  assert.deepEqual([1, 0, 4, 9].map((from) => step(from, -1)), [0, 4, 2, 2]);
  assert.equal(stepFrom([0, 1], [], 0, 1), undefined);
});
