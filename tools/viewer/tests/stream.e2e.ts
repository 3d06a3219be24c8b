// SPDX-License-Identifier: BSD-2-Clause
// The rest of the points from the Potree folder beside a served page. Needs PMSP_DENSIFY and PMSP_SYNTH; exits with 77
// where there is no chromium.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { cpSync, mkdirSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import type { Browser, Page } from "playwright-core";
import { chromiumPath, difference, idle, openFile, openPage, startBrowser } from "./browser";
import { killAll, start, type Started } from "./program";

const { PMSP_DENSIFY: densify, PMSP_SYNTH: synth } = process.env;
if (!chromiumPath() || !densify || !synth) {
  console.log("skipped: no chromium, or PMSP_DENSIFY and PMSP_SYNTH are not set");
  process.exit(77);
}

const folder = mkdtempSync(join(tmpdir(), "pmsp-stream-"));
const results = join(folder, "results");
const report = join(results, "report.html");
const kHeld = 3000;
let browser: Browser;
let served: Started;
let all = 0;

before(async () => {
  const mission = join(folder, "mission");
  execFileSync(synth, ["--scene", "room", "--width", "512", "--keyframes", "6", "-o", mission], { stdio: "ignore" });
  mkdirSync(results);
  execFileSync(
    densify,
    ["run", join(mission, "map.msg"), "--images", join(mission, "images"), "-o", join(results, "the cloud.potree"), "--report", report]
      .concat(["--report-points", String(kHeld), "--quality", "online", "--backend", "cpu", "--width", "512", "--height", "256", "--progress", "none"]),
    { stdio: ["ignore", "ignore", "inherit"] },
  );
  all = (JSON.parse(readFileSync(join(results, "the cloud.potree", "metadata.json"), "utf8")) as { points: number }).points;
  browser = await startBrowser();
  served = await start(densify, ["serve", report]);
});

after(async () => {
  await browser?.close();
  killAll();
  rmSync(folder, { recursive: true });
});

interface Streamed {
  loaded: number;
  streamed: number;
  inFlight: number;
  cubes: number;
}
const streamed = (page: Page): Promise<Streamed> =>
  page.evaluate(() => {
    const { viewer } = (window as any).pmspPage;
    const { stream } = viewer;
    const cubes = stream.all.filter((it: any) => it.isLoaded && it.node.points > it.held).length;
    return { loaded: viewer.cloud.loaded, streamed: stream.loadedPoints, inFlight: stream.inFlight, cubes };
  });

/** Waits until nothing more comes. */
async function settled(page: Page): Promise<Streamed> {
  await idle(page);
  return streamed(page);
}

const lookFrom = (page: Page, nearness: number): Promise<void> =>
  page.evaluate((nearness) => {
    const { viewer } = (window as any).pmspPage;
    viewer.setMode("orbit");
    for (let i = 0; i < nearness; ++i) viewer.nudge(0, 0, 1);
  }, nearness);

test("from disk the page holds its points and asks for none", async () => {
  const { page, requests, errors } = await openFile(browser, report);
  await idle(page);
  assert.deepEqual(requests, []);
  assert.deepEqual(errors, []);
  const [held, stream] = (await page.evaluate(() => {
    const { viewer } = (window as any).pmspPage;
    return [viewer.cloud.loaded, viewer.stream];
  })) as [number, unknown];
  assert.ok(held > 0.8 * kHeld && held <= kHeld);
  assert.equal(stream, null);
  await page.context().close();
});

test("served, it takes the rest in parts of a file, the more the nearer one comes", async () => {
  const statuses = new Map<string, Set<number>>();
  const { page, requests, errors } = await openPage(browser, served.url);
  page.on("response", (reply) => {
    const name = reply.url().split("/").pop() ?? "";
    statuses.set(name, (statuses.get(name) ?? new Set()).add(reply.status()));
  });
  await page.waitForSelector('body[data-stream="open"]');
  await lookFrom(page, 0);
  const far = await settled(page);
  assert.ok(far.loaded > 1.5 * kHeld, `${far.loaded} points`);
  await lookFrom(page, 6);
  const near = await settled(page);
  assert.ok(near.loaded > far.loaded, `${near.loaded} points, ${far.loaded} before`);
  assert.ok(near.loaded <= all);
  assert.deepEqual([...(statuses.get("octree.bin") ?? [])], [206]);
  const text = (await page.textContent("#subtitle")) ?? "";
  assert.ok(text.replaceAll(" ", "").startsWith(`${near.loaded}of${all}points`), text);
  assert.deepEqual(requests, []);
  assert.deepEqual(errors, []);
  console.log(`# ${kHeld} points held, ${far.loaded} from outside, ${near.loaded} from near, ${all} in all`);
  await page.context().close();
});

test("the picture sharpens as points come, to that of all points", async () => {
  const { page } = await openPage(browser, `${served.url}#color=height`);
  const picture = (): Promise<Buffer> => page.locator("#points").screenshot({ type: "png" });
  let release = (): void => {};
  const held = new Promise<void>((done) => (release = done));
  await page.route("**/octree.bin", async (route) => {
    await held;
    await route.continue();
  });
  await page.reload();
  await page.waitForSelector('body[data-stream="open"]');
  await page.waitForFunction(() => (window as any).pmspPage.viewer.frames.isIdle);
  const coarse = await picture();
  release();
  await idle(page);
  const fine = await picture();
  await page.evaluate(async () => {
    const { stream } = (window as any).pmspPage.viewer;
    for (const it of stream.all) if (!it.isLoaded) await stream.load(it);
  });
  await idle(page);
  const all = await picture();
  const [before, after] = [await difference(page, coarse, all), await difference(page, fine, all)];
  console.log(`# mean difference to all points: ${before.mean.toFixed(4)} with the points held, ${after.mean.toFixed(4)} streamed`);
  assert.ok(after.mean < 0.01, `${after.mean}`);
  assert.ok(after.mean < 0.5 * before.mean, `${before.mean} ${after.mean}`);
  await page.context().close();
});

test("points that came lie on the room's walls, each once", async () => {
  const { page } = await openPage(browser, served.url);
  await page.waitForSelector('body[data-stream="open"]');
  await lookFrom(page, 8);
  await settled(page);
  const [off, count, twice] = (await page.evaluate(() => {
    const { viewer } = (window as any).pmspPage;
    const off: number[] = [];
    const places = new Set<string>();
    let count = 0;
    viewer.cloud.forEach(1, (x: number, y: number, z: number) => {
      const at = [x, y, z].map((v, i) => v + viewer.data.origin[i]);
      const fromWalls = at.map((v, i) => Math.abs(Math.abs(v) - [3, 1.5, 4][i]!));
      off.push(Math.min(...fromWalls));
      places.add(at.map((v) => v.toFixed(4)).join());
      count += 1;
    });
    off.sort((a, b) => a - b);
    return [off[Math.floor(0.9 * off.length)], count, count - places.size];
  })) as [number, number, number];
  assert.ok(off < 0.1, `nine tenths of the points lie within ${off} of a wall`);
  assert.ok(twice < 0.01 * count, `${twice} of ${count} points are there twice`);
  await page.context().close();
});

test("a measurement knows which cameras saw its points", async () => {
  const { page } = await openPage(browser, served.url, { hash: "view=walk&keyframe=2" });
  await page.waitForSelector('body[data-stream="open"]');
  await settled(page);
  const pick = async (corner: number[]): Promise<{ keyframe: number }> => {
    const look = (take: boolean): Promise<{ keyframe: number }> =>
      page.evaluate(
        ([corner, take]) => {
          const { viewer } = (window as any).pmspPage;
          const at = corner.map((v, i) => v - viewer.data.origin[i]);
          const eye = viewer.perspective.position.toArray();
          viewer.lookAlong(at.map((v: number, i: number) => v - eye[i]));
          viewer.draw();
          return take ? viewer.pick(...viewer.project(at)) : null;
        },
        [corner, take] as const,
      );
    await look(false);
    await settled(page);
    return look(true);
  };
  const points = [await pick([-3, -1.5, 4]), await pick([3, -1.5, 4])];
  const found = (await page.evaluate(
    (points) => (window as any).pmspPage.viewer.result({ kind: "distance", points }),
    points,
  )) as { value: number; error: number; text: string };
  console.log(`# width: ${found.text}, truly 6`);
  assert.ok(points.every((p) => p.keyframe >= 0));
  assert.ok(Math.abs(found.value - 6) <= found.error, found.text);
  await page.context().close();
});

test("what is far goes where the budget is spent", async () => {
  const { page, errors } = await openPage(browser, served.url);
  await page.waitForSelector('body[data-stream="open"]');
  const budget = 60_000;
  await page.evaluate((budget) => ((window as any).pmspPage.viewer.stream.budget = budget), budget);
  const turns: Streamed[] = [];
  for (let turn = 0; turn < 5; ++turn) {
    await page.evaluate((turn) => {
      const { viewer } = (window as any).pmspPage;
      viewer.setMode("walk");
      viewer.perspective.fov = 30;
      viewer.lookAlong([Math.cos(turn * 1.3), Math.sin(turn * 1.3), 0]);
    }, turn);
    turns.push(await settled(page));
  }
  for (const it of turns) assert.ok(it.streamed <= budget, `${it.streamed} points in memory`);
  assert.ok(turns.some((it) => it.cubes > 0));
  assert.ok(turns.every((it) => it.loaded === kHeldOf(turns[0]!) + it.streamed), "what goes leaves what the page holds");
  assert.deepEqual(errors, []);
  await page.context().close();
});
const kHeldOf = (it: Streamed): number => it.loaded - it.streamed;

test("another cloud in the folder is refused, and so is none", async () => {
  const other = join(folder, "other");
  cpSync(results, other, { recursive: true });
  const mission = join(folder, "mission");
  execFileSync(
    densify,
    ["run", join(mission, "map.msg"), "--images", join(mission, "images"), "-o", join(other, "the cloud.potree"), "--force"]
      .concat(["--scale", "3", "--quality", "online", "--backend", "cpu", "--width", "128", "--height", "64", "--progress", "none"]),
    { stdio: ["ignore", "ignore", "inherit"] },
  );
  const it = await start(densify, ["serve", join(other, "report.html")]);
  const { page } = await openPage(browser, it.url);
  await page.waitForSelector('body[data-stream="refused"]');
  assert.match((await page.textContent("#message")) ?? "", /another cloud than this page/);
  assert.ok((await page.evaluate(() => (window as any).pmspPage.viewer.cloud.loaded)) > 0.8 * kHeld);
  rmSync(join(other, "the cloud.potree"), { recursive: true });
  await page.reload();
  await page.waitForSelector('body[data-stream="refused"]');
  assert.match((await page.textContent("#message")) ?? "", /404/);
  await page.context().close();
  it.child.kill("SIGINT");
});

test("a server that goes away leaves the page usable", async () => {
  const port = 20000 + (process.pid % 20000);
  const first = await start(densify, ["serve", report, "--port", String(port)]);
  const { page } = await openPage(browser, first.url);
  await page.waitForSelector('body[data-stream="open"]');
  await lookFrom(page, 0);
  await settled(page);
  first.child.kill("SIGKILL");
  await first.ended;
  await lookFrom(page, 8);
  await page.waitForSelector('body[data-stream="lost"]', { timeout: 20_000 });
  assert.match((await page.textContent("#message")) ?? "", /cannot be had at the moment/);
  await page.click("text=Plan");
  assert.ok((await streamed(page)).loaded > kHeld);
  await page.context().close();
});
