// SPDX-License-Identifier: BSD-2-Clause
// What comes over HTTP, in a real browser: a report that is served, a run that is looked at while it works, and a SLAM
// whose keyframes move. Needs PMSP_DENSIFY, PMSP_SYNTH and PMSP_LIVE_PLAYER; exits with 77 where there is no chromium.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { copyFileSync, cpSync, existsSync, mkdirSync, mkdtempSync, readdirSync, readFileSync, renameSync, rmSync, statSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import type { Browser, Page } from "playwright-core";
import { chromiumPath, openFile, openPage, startBrowser, violations } from "./browser";
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

/** Small, since it is drawn in software. */
const kWindow = { width: 700, height: 600 };

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

const fetchedOf = (page: Page): Promise<number> => page.evaluate(() => (window as any).pmspPage.live.live.fetched);

async function hasCubes(page: Page, count: number): Promise<void> {
  const has = (least: number): boolean => (window as any).pmspPage.viewer.cloud.keyframeCubes.size >= least;
  await page.waitForFunction(has, count, { timeout: 300_000 });
}

/** Waits until the page shows all that the server has. */
async function hasCaughtUp(page: Page): Promise<void> {
  const shows = async (): Promise<boolean> => {
    const { live } = (window as any).pmspPage.live;
    const reply = await fetch(`live/changes?page_version=${live.pageVersion}&state_version=0&since=0&client=${live.client}`);
    const all = (await reply.json()) as { version: number; clouds: { id: string; points_version: number }[] };
    return live.since === all.version && all.clouds.every((it) => live.shown.get(it.id) === it.points_version);
  };
  for (const end = Date.now() + 120_000; !(await page.evaluate(shows)); await page.waitForTimeout(100)) {
    assert.ok(Date.now() < end, "the page does not show what the server has");
  }
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

/** The camera is in the middle of the views from outside until Follow is switched off. */
async function checkFollowing(page: Page): Promise<void> {
  const off = (): Promise<number> =>
    page.evaluate(() => {
      const { viewer, live } = (window as any).pmspPage;
      viewer.draw();
      const [x, y] = viewer.project(live.live.camera.center);
      return Math.hypot(x - viewer.canvas.clientWidth / 2, y - viewer.canvas.clientHeight / 2);
    });
  for (const view of ["Plan", "Around"]) {
    await page.click(`#toolbar >> text=${view}`);
    assert.ok((await off()) < 2, `${view}: the camera is ${await off()} px off the middle`);
  }
  await page.click("#live >> text=Follow");
  await page.click("#toolbar >> text=Around");
  assert.ok((await off()) > 5, "without Follow the view shows all");
  await page.click("#live >> text=Follow");
  assert.ok((await off()) < 2);
}

/** Share of the plan that keyframes have seen, and number of hatched pixels. */
async function planOf(page: Page): Promise<{ seen: number; hatched: number }> {
  await page.waitForFunction(() => (window as any).pmspPage.live.seen.grid !== null);
  await page.click("#toolbar >> text=Plan");
  const found = await page.evaluate(() => {
    const { viewer, live } = (window as any).pmspPage;
    viewer.draw();
    const canvas = viewer.overlay.canvas as HTMLCanvasElement;
    const { data } = canvas.getContext("2d")!.getImageData(0, 0, canvas.width, canvas.height);
    let hatched = 0;
    for (let i = 0; i < data.length; i += 4) {
      hatched += data[i + 3]! > 60 && data[i]! > 200 && data[i + 1]! < 200 && data[i + 2]! < 40 ? 1 : 0;
    }
    const { seen } = live.seen.grid;
    return { seen: seen.filter((it: number) => it === 1).length / seen.length, hatched };
  });
  await page.click("#toolbar >> text=Around");
  return found;
}

test("a report that is served is the page that opens from disk", async () => {
  const report = join(folder, "report.html");
  execFileSync(densify, run("--report", report), { stdio: "ignore" });
  const served = await start(densify, ["serve", report]);
  const { page, requests, errors } = await openPage(browser, served.url, kWindow);
  assert.ok((await shown(page)).points > 1000);
  assert.ok((await light(page)) > 0.1);
  assert.deepEqual(requests, []);
  assert.deepEqual(errors, []);
  await page.context().close();
  served.child.kill("SIGINT");
  assert.equal(await served.ended, 0);
});

test("every keyframe of a report has its photo where photos are served, and from disk those that it contains", async () => {
  const results = join(folder, "results");
  const report = join(results, "mission.html");
  const photos = join(results, "photos of it");
  mkdirSync(results);
  execFileSync(densify, run("--report", report, "--report-photos", photos, "--report-panoramas", "1"), { stdio: "ignore" });
  for (const kind of [".jpg", ".depth"]) assert.equal(readdirSync(photos).filter((it) => it.endsWith(kind)).length, 8, kind);
  const withPhoto = (page: Page): Promise<number[]> =>
    page.evaluate(() => {
      const { viewer } = (window as any).pmspPage;
      const found: number[] = [];
      for (let i = 0; i < viewer.data.keyframes.length; ++i) {
        viewer.state.keyframe = i;
        viewer.setMode("keyframe");
        if (viewer.state.keyframe === i) found.push(i);
      }
      return found;
    });
  const ready = (page: Page): Promise<unknown> => page.waitForFunction(() => (window as any).pmspPage.viewer.panorama.ready);
  const served = await start(densify, ["serve", report]);
  const { page, requests, errors } = await openPage(browser, served.url, kWindow);
  assert.equal((await withPhoto(page)).length, 8);
  for (let i = 0; i < 3; ++i) {
    await ready(page);
    await page.click("text=▶");
  }
  await ready(page);
  assert.deepEqual(requests, []);
  assert.deepEqual(errors, []);
  await page.context().close();
  const disk = await openFile(browser, report);
  assert.equal((await withPhoto(disk.page)).length, 1);
  await ready(disk.page);
  assert.deepEqual(disk.errors, []);
  assert.deepEqual(disk.requests, []);
  await disk.page.context().close();
  rmSync(photos, { recursive: true });
  const without = await openPage(browser, served.url, kWindow);
  await without.page.waitForFunction(() => (window as any).pmspPage.data.keyframes.every((k: any) => k.photo === undefined));
  assert.equal((await withPhoto(without.page)).length, 1);
  await ready(without.page);
  await without.page.context().close();
  served.child.kill("SIGINT");
  assert.equal(await served.ended, 0);
});

test("a run is seen from its first second, up to its report at the same address", async () => {
  const own = join(folder, "own");
  cpSync(mission, own, { recursive: true });
  const map = join(own, "map.msg");
  renameSync(map, join(own, "later"));
  const token = join(folder, "token");
  const report = join(folder, "out", "own.html");
  mkdirSync(join(folder, "out"));
  const words = (port: string): string[] => {
    const output = ["-o", join(folder, "o.ply"), "--workspace", join(folder, "own-work"), "--report", report];
    const live = ["--follow", "--live-view", port, "--live-token", token, "--live-keep"];
    return ["run", map, "--images", join(own, "images"), ...quick, "--width", "512", "--height", "256", ...output, ...live];
  };
  const first = await start(densify, words("0"));
  assert.ok(first.url.endsWith(`/${readFileSync(token, "utf8").trim()}/`));
  const { page, requests, errors } = await openPage(browser, first.url, kWindow);
  await page.evaluate(() => ((window as any).isOfFirstRun = true));
  await page.addInitScript(() => {
    const log = ((window as any).log = { order: [] as string[], shares: [] as number[], texts: [] as string[] });
    const note = (name: string, is: boolean): void => {
      if (is && !log.order.includes(name)) log.order.push(name);
    };
    setInterval(() => {
      const { live, viewer } = (window as any).pmspPage ?? {};
      if (!live) return;
      note("landmarks", live.seen.landmarks.length > 0);
      note("photo", document.querySelector("#newest")!.hasAttribute("src"));
      note("points", viewer.cloud.loaded > 0);
      const { share } = live.live.progress;
      if (share !== null && share !== log.shares.at(-1)) log.shares.push(share);
      log.texts.push(document.querySelector("#progress")?.textContent ?? "");
    }, 10);
  });
  first.child.kill("SIGKILL"); // while it waits for the map
  await first.ended;
  const started = await start(densify, words(new URL(first.url).port));
  assert.equal(started.url, first.url);
  // The page of the first run finds the second one.
  await page.waitForFunction(() => (window as any).isOfFirstRun === undefined && (window as any).pmspPage?.live, null, { timeout: 120_000 });
  renameSync(join(own, "later"), map);
  await page.waitForFunction(() => (window as any).log?.order.includes("points"), null, { timeout: 300_000 });
  await page.waitForSelector("text=Open the report", { timeout: 300_000 });
  await page.waitForFunction(() => (document.querySelector("#newest") as HTMLImageElement).naturalWidth > 0);
  const log = (await page.evaluate(() => (window as any).log)) as { order: string[]; shares: number[]; texts: string[] };
  assert.deepEqual([...log.order].sort(), ["landmarks", "photo", "points"]);
  assert.equal(log.order.at(-1), "points", `order: ${log.order}`);
  assert.ok(log.shares.some((it) => it > 0 && it < 1), `shares: ${log.shares}`);
  assert.ok(log.texts.some((it) => /^densify: [\d.]+ %, \d.* left$/.test(it)), `texts: ${[...new Set(log.texts)].join("; ")}`);
  assert.deepEqual(await violations(page), []);
  assert.deepEqual(requests, []);
  assert.deepEqual(errors.filter((it) => !/Failed to load|ERR_CONNECTION/.test(it)), []);
  await page.click("#toolbar >> text=Photo");
  await page.waitForFunction(() => (window as any).pmspPage.viewer.panorama.ready);
  const address = page.url().replace(/#.*/, "");
  await page.click("text=Open the report");
  await page.waitForURL(/report\/own\.html/);
  await page.waitForSelector('body[data-state="loaded"]');
  assert.ok(page.url().startsWith(`${address}report/own.html`));
  assert.ok((await shown(page)).points > 1000);
  assert.equal(started.child.exitCode, null);
  started.child.kill("SIGINT");
  assert.equal(await started.ended, 0);
  await page.context().close();
});

test("a run shows its points while it works, says when it is done, and then ends", async () => {
  const started = await start(densify, run("--live-view", "0", "--threads", "1", "--width", "512", "--height", "256"));
  const { page, requests, errors } = await openPage(browser, started.url, kWindow);
  await page.waitForFunction(() => (window as any).pmspPage.viewer.cloud.loaded > 1000, null, { timeout: 300_000 });
  const first = await shown(page);
  await page.waitForSelector('body[data-live="done"]', { timeout: 300_000 });
  const last = await shown(page);
  assert.equal(await started.ended, 0);
  assert.ok(last.points >= first.points);
  assert.equal(last.keyframes, 8);
  assert.ok(Object.keys(last.cubes).length > 3);
  assert.ok((await light(page)) > 0.1);
  const share = /^(\d+) % of the cloud: ([\d ]+) of ([\d ]+) points of \d of 8 keyframes/.exec((await page.textContent("#subtitle")) ?? "");
  const [percent, some, all] = (share ?? []).slice(1).map((it) => Number(it.replaceAll(" ", ""))) as [number, number, number];
  assert.equal(some, last.points);
  assert.equal(all, Number(/element vertex (\d+)/.exec(readFileSync(join(folder, "c.ply"), "latin1"))?.[1]));
  assert.equal(percent, Math.round((100 * some) / all));
  // The room is closed: but for the mask, the camera has points in nearly all directions.
  await page.waitForFunction(() => (window as any).pmspPage.live.around.covered?.open < 0.3);
  assert.match((await page.textContent("#around")) ?? "", /% of the directions from the camera have no points yet/);
  assert.deepEqual(await violations(page), []);
  // The camera stands where the newest keyframe does, which is the last of the trajectory.
  const [camera, newest] = (await page.evaluate(() => {
    const { camera, places } = (window as any).pmspPage.viewer.trajectory;
    return [camera, places.at(-1).center];
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
  const { page, errors } = await openPage(browser, started.url, kWindow);
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
  await page.click("text=Distance");
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
  assert.equal(await page.textContent("#message"), "Click two points.", "updates keep what measuring says");
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
  const { page, errors } = await openPage(browser, started.url, kWindow);
  const other = await openPage(browser, started.url, kWindow);
  const blank = await planOf(page);
  assert.equal(blank.seen, 0);
  assert.ok(blank.hatched > 1000);
  started.child.stdin!.write("fly\n");
  await page.waitForFunction(() => (window as any).pmspPage.viewer.cloud.loaded > 0, null, { timeout: 300_000 });
  const seen = (await page.evaluate(() => performance.timeOrigin + (window as any).pmspPage.live.live.lastPoints)) as number;
  await hasCubes(page, 4);
  while (!/flown/.test(started.text())) await new Promise((done) => setTimeout(done, 100));
  for (const it of [page, other.page]) await hasCaughtUp(it);
  const before = await shown(page);
  const fetched = await fetchedOf(page);
  await checkFollowing(page);
  await page.waitForFunction(() => (window as any).pmspPage.live.seen.grid.seen.every((it: number) => it === 1));
  assert.equal((await planOf(page)).hatched, 0);
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
