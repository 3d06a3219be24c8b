// SPDX-License-Identifier: BSD-2-Clause
// What comes over HTTP, in a real browser: a report that is served, a run that is looked at while it works, and a SLAM
// whose keyframes move. Needs PMSP_DENSIFY, PMSP_SYNTH and PMSP_LIVE_PLAYER; exits with 77 where there is no chromium.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { copyFileSync, existsSync, mkdtempSync, renameSync, rmSync, statSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import type { Browser, Page } from "playwright-core";
import { chromiumPath, openPage, startBrowser, violations } from "./browser";
import { killAll, start } from "./program";

const { PMSP_DENSIFY: densify, PMSP_SYNTH: synth, PMSP_LIVE_PLAYER: player } = process.env;
if (!chromiumPath() || !densify || !synth || !player) {
  console.log("skipped: no chromium, or PMSP_DENSIFY, PMSP_SYNTH and PMSP_LIVE_PLAYER are not set");
  process.exit(77);
}

const folder = mkdtempSync(join(tmpdir(), "pmsp-live-"));
const mission = join(folder, "mission");
let browser: Browser;

before(async () => {
  execFileSync(synth, ["--scene", "room", "--width", "512", "--keyframes", "8", "-o", mission], { stdio: "ignore" });
  browser = await startBrowser();
});

after(async () => {
  killAll();
  await browser?.close();
  rmSync(folder, { recursive: true });
});

const quick = ["--quality", "online", "--backend", "cpu", "--width", "256", "--height", "128", "--progress", "none"];
const run = (...more: string[]): string[] =>
  ["run", join(mission, "map.msg"), "--images", join(mission, "images"), "-o", join(folder, "c.ply"), "--force", ...quick, ...more];

interface Shown {
  points: number;
  /** Centres of the keyframes' cubes. */
  cubes: Record<string, number[]>;
  /** Where the keyframes' cameras stood. */
  centers: Record<string, number[]>;
  keyframes: number;
  state: string | undefined;
}

const shown = (page: Page): Promise<Shown> =>
  page.evaluate(() => {
    const { viewer } = (window as any).pmspPage;
    const cubes: Record<string, number[]> = {};
    for (const [id, cube] of viewer.cloud.keyframeCubes) cubes[id] = cube.center.toArray();
    const centers = Object.fromEntries(viewer.data.keyframes.map((k: any) => [k.id, k.center]));
    return { points: viewer.cloud.loaded, cubes, centers, keyframes: viewer.data.keyframes.length, state: document.body.dataset["live"] };
  });

const fetchedOf = (page: Page): Promise<number> => page.evaluate(() => (window as any).pmspPage.live.fetched);

async function hasCubes(page: Page, count: number): Promise<void> {
  const has = (least: number): boolean => (window as any).pmspPage.viewer.cloud.keyframeCubes.size >= least;
  await page.waitForFunction(has, count, { timeout: 300_000 });
}

/** Waits until nothing has come for a while. */
async function hasCaughtUp(page: Page): Promise<void> {
  for (let before = -1, now = 0; before !== now; before = now, now = await fetchedOf(page)) await page.waitForTimeout(1500);
}

const light = (page: Page): Promise<number> =>
  page.evaluate(() => {
    const { viewer } = (window as any).pmspPage;
    const picture = viewer.picture();
    const { data } = picture.getContext("2d").getImageData(0, 0, picture.width, picture.height);
    let light = 0;
    for (let i = 0; i < data.length; i += 4) light += data[i] + data[i + 1] + data[i + 2] > 120 ? 1 : 0;
    return light / (data.length / 4);
  });

test("a report that is served is the page that opens from disk", async () => {
  const report = join(folder, "report.html");
  execFileSync(densify, run("--report", report), { stdio: "ignore" });
  const served = await start(densify, ["serve", report]);
  const { page, requests, errors } = await openPage(browser, served.url);
  assert.ok((await shown(page)).points > 1000);
  assert.ok((await light(page)) > 0.1);
  assert.deepEqual(requests, []);
  assert.deepEqual(errors, []);
  await page.context().close();
  served.child.kill("SIGINT");
  assert.equal(await served.ended, 0);
});

test("a run shows its points while it works, says when it is done, and then ends", async () => {
  const started = await start(densify, run("--live-view", "0", "--threads", "1", "--width", "512", "--height", "256"));
  const { page, requests, errors } = await openPage(browser, started.url);
  await page.waitForFunction(() => (window as any).pmspPage.viewer.cloud.loaded > 1000, null, { timeout: 300_000 });
  const first = await shown(page);
  await page.waitForSelector('body[data-live="done"]', { timeout: 300_000 });
  const last = await shown(page);
  assert.equal(await started.ended, 0);
  assert.ok(last.points >= first.points);
  assert.equal(last.keyframes, 8);
  assert.ok(Object.keys(last.cubes).length > 3);
  assert.ok((await light(page)) > 0.1);
  assert.match((await page.textContent("#subtitle")) ?? "", /points of \d of 8 keyframes/);
  // The room is closed: but for the mask, the camera has points in nearly all directions.
  await page.waitForFunction(() => (window as any).pmspPage.around.covered !== null);
  await page.waitForTimeout(1000);
  const open = (await page.evaluate(() => (window as any).pmspPage.around.covered.open)) as number;
  assert.ok(open < 0.3, `${open} of the directions have no points`);
  assert.match((await page.textContent("#around")) ?? "", /% of the directions from the camera have no points yet/);
  assert.deepEqual(await violations(page), []);
  // The camera stands where the newest keyframe does, which is the last of the trajectory.
  const [camera, newest] = (await page.evaluate(() => {
    const { trail } = (window as any).pmspPage.viewer;
    return [trail.camera, trail.keyframes.at(-1).center];
  })) as [number[], number[]];
  assert.ok(Math.hypot(...camera.map((v, i) => v - newest[i]!)) < 0.01, `camera at ${camera}, newest keyframe at ${newest}`);
  await page.click("text=Flight");
  await page.click("text=Plan");
  assert.deepEqual(requests, []);
  assert.deepEqual(errors, []);
  await page.context().close();
});

test("keyframes that a newer map has moved move in the page, and their points are not sent again", async () => {
  const larger = join(folder, "larger"); // the same flight in a map of twice the scale
  const small = ["--scene", "room", "--width", "512", "--keyframes", "8", "--map-scale"];
  execFileSync(synth, [...small, "2", "-o", larger], { stdio: "ignore" });
  const own = join(folder, "followed");
  execFileSync(synth, [...small, "1", "-o", own], { stdio: "ignore" });
  const words = ["run", join(own, "map.msg"), "--images", join(own, "images"), "-o", join(folder, "f.ply"), ...quick];
  const started = await start(densify, [...words, "--live-view", "0", "--follow", "--workspace", join(folder, "work")]);
  const { page, errors } = await openPage(browser, started.url);
  await hasCubes(page, 4);
  const cloud = join(folder, "f.ply");
  const writtenAfter = async (then: number): Promise<number> => {
    for (;;) {
      const now = existsSync(cloud) ? statSync(cloud).mtimeMs : 0;
      if (now > then) return now;
      await page.waitForTimeout(100);
    }
  };
  const first = await writtenAfter(0);
  await hasCaughtUp(page);
  const before = await shown(page);
  const fetched = await fetchedOf(page);
  copyFileSync(join(larger, "map.msg"), join(own, "map.new"));
  renameSync(join(own, "map.new"), join(own, "map.msg"));
  const length = (x: number[]): number => Math.hypot(...x);
  await page.waitForFunction(
    (old) => {
      const now = (window as any).pmspPage.viewer.data.keyframes;
      return now.length > 0 && now.every((k: any) => Math.hypot(...k.center) > 1.9 * Math.hypot(...(old[k.id] ?? [1e9])));
    },
    before.centers,
    { timeout: 120_000 },
  );
  await writtenAfter(first);
  await hasCaughtUp(page);
  const after = await shown(page);
  assert.deepEqual(Object.keys(after.cubes).sort(), Object.keys(before.cubes).sort());
  for (const [id, at] of Object.entries(before.centers)) {
    const off = length(at.map((x, i) => 2 * x - (after.centers[id]?.[i] ?? Number.NaN)));
    assert.ok(off < 1e-6 * (1 + length(at)), `keyframe ${id} is ${off} away from where the map has it`);
  }
  for (const [id, at] of Object.entries(before.cubes)) {
    const off = length(at.map((x, i) => 2 * x - (after.cubes[id]?.[i] ?? Number.NaN)));
    assert.ok(off < 0.02 * length(at), `points of keyframe ${id} are ${off} away from where they should be`);
  }
  assert.equal(await fetchedOf(page), fetched, "what only moves is not sent again");
  started.child.kill("SIGINT");
  await page.waitForSelector('body[data-live="done"]', { timeout: 60_000 });
  assert.equal(await started.ended, 0);
  assert.deepEqual(errors, []);
  await page.context().close();
});

test("points of a SLAM come at once, and move with their keyframes", async () => {
  const started = await start(player, [join(mission, "map.msg"), join(mission, "images")]);
  const { page, errors } = await openPage(browser, started.url);
  const other = await openPage(browser, started.url);
  started.child.stdin!.write("fly\n");
  await page.waitForFunction(() => (window as any).pmspPage.viewer.cloud.loaded > 0, null, { timeout: 300_000 });
  const seen = (await page.evaluate(() => performance.timeOrigin + (window as any).pmspPage.live.lastPoints)) as number;
  await hasCubes(page, 4);
  while (!/flown/.test(started.text())) await new Promise((done) => setTimeout(done, 100));
  for (const it of [page, other.page]) await hasCaughtUp(it);
  const before = await shown(page);
  const fetched = await fetchedOf(page);
  started.child.stdin!.write("move\n");
  const moved = (now: Record<string, number[]>, then: Record<string, number[]>): number[] =>
    Object.entries(then).map(([id, at]) => Math.hypot(...at.map((x, i) => x - (now[id]?.[i] ?? Number.NaN))));
  await page.waitForFunction(
    (old) => {
      const { keyframeCubes } = (window as any).pmspPage.viewer.cloud;
      return Object.entries(old).every(([id, at]) => Math.abs((keyframeCubes.get(id)?.center.x ?? 0) - at[0]!) > 5);
    },
    before.cubes,
    { timeout: 60_000 },
  );
  for (const it of [page, other.page]) await hasCaughtUp(it);
  const after = await shown(page);
  assert.deepEqual(Object.keys(after.cubes).sort(), Object.keys(before.cubes).sort());
  assert.equal(await fetchedOf(page), fetched, "what only moves is not sent again");
  for (const by of moved(after.centers, before.centers)) assert.ok(Math.abs(by - 10) < 1e-6, `moved by ${by}, not by 10`);
  for (const by of moved(after.cubes, before.cubes)) assert.ok(Math.abs(by - 10) < 1e-3, `points moved by ${by}, not by 10`);
  assert.deepEqual((await shown(other.page)).cubes, after.cubes);
  started.child.stdin!.write("erase\n");
  const left = Object.keys(after.cubes).length - 1;
  await page.waitForFunction((count) => (window as any).pmspPage.viewer.cloud.keyframeCubes.size === count, left);
  const told = /first points at (\d+)/.exec(started.text());
  console.log(`# first points in the picture ${(seen - Number(told?.[1])).toFixed(0)} ms after they existed`);
  started.child.stdin!.write("end\n");
  await page.waitForSelector('body[data-live="done"]');
  assert.equal(await started.ended, 0);
  assert.deepEqual(errors, []);
  await page.context().close();
  await other.page.context().close();
});
