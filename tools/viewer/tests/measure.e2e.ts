// SPDX-License-Identifier: BSD-2-Clause
// Measuring in a real browser: photos, known lengths, the table and its files. Needs PMSP_DENSIFY and PMSP_SYNTH; exits
// with 77 where there is no chromium.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import type { Browser, Page } from "playwright-core";
import type { ReportData } from "../src/data";
import { type Vec3, norm, sub } from "../src/geometry";
import { chromiumPath, idle, openFile, openPage, skipInFirefox, startBrowser, violations } from "./browser";
import { killAll, start } from "./program";

type Viewed = { pmspPage: any };

if (!chromiumPath() || !process.env["PMSP_DENSIFY"] || !process.env["PMSP_SYNTH"]) {
  console.log("skipped: no chromium, or PMSP_DENSIFY and PMSP_SYNTH are not set");
  process.exit(77);
}
const densify = process.env["PMSP_DENSIFY"]!;
const folder = mkdtempSync(join(tmpdir(), "pmsp-measure-"));
const report = join(folder, "report.html");
let browser: Browser;
let data: ReportData;
const half: Vec3 = [3, 1.5, 4];
/** Of the synthetic room, in metres, which are the units of its map. */
const corner = (x: number, y: number, z: number): Vec3 => sub([x * half[0], y * half[1], z * half[2]], data.origin);

before(async () => {
  const mission = join(folder, "mission");
  execFileSync(process.env["PMSP_SYNTH"]!, ["--scene", "room", "--width", "1024", "--keyframes", "5", "-o", mission], { stdio: "ignore" });
  execFileSync(
    densify,
    ["run", join(mission, "map.msg"), "--images", join(mission, "images"), "-o", join(folder, "c.ply"), "--report", report]
      .concat(["--quality", "online", "--backend", "cpu", "--width", "512", "--height", "256", "--progress", "none"])
      .concat(["--report-panoramas", "2", "--report-photos", join(folder, "photos")]),
    { stdio: ["ignore", "ignore", "inherit"], cwd: folder },
  );
  const text = readFileSync(report, "utf8");
  const tag = '<script type="application/json" id="pmsp-data">';
  const begin = text.indexOf(tag) + tag.length;
  data = JSON.parse(text.slice(begin, text.indexOf("</script>", begin))) as ReportData;
  browser = await startBrowser();
});

after(async () => {
  killAll();
  await browser?.close();
  rmSync(folder, { recursive: true });
});

const photos = (): number[] => data.keyframes.flatMap((k, i) => (k.panorama && k.depths ? [i] : []));
const message = (page: Page): Promise<string> => page.textContent("#message").then((text) => text ?? "");
const rows = (page: Page): Promise<number> => page.locator("#results tbody tr").count();

/** Turns the picture to a place and clicks on it. */
async function clickAt(page: Page, place: Vec3, modifiers: "Shift"[] = []): Promise<void> {
  const at = await page.evaluate((place) => {
    const { viewer } = (window as unknown as Viewed).pmspPage;
    const eye = viewer.perspective.position.toArray();
    viewer.lookAlong([place[0] - eye[0], place[1] - eye[1], place[2] - eye[2]]);
    viewer.draw();
    return viewer.project(place) as [number, number];
  }, place);
  await page.locator("#points").click({ position: { x: at[0], y: at[1] }, modifiers });
}

const addressWith = (page: Page, part: string): Promise<unknown> => page.waitForFunction((part) => location.hash.includes(part), part);

/** A page on which distances were measured from corner to corner of the room's ceiling. */
async function measured(hash = "", notes = 0): Promise<{ page: Page; errors: string[] }> {
  const { page, errors } = await openFile(browser, report, { hash: `view=keyframe&keyframe=${photos()[1]}${hash}` });
  await page.click("text=Distance");
  for (const place of [corner(-1, -1, -1), corner(-1, -1, 1)]) await clickAt(page, place);
  assert.equal(await rows(page), 1 + notes, await message(page));
  return { page, errors };
}

const pairs = (): [Vec3, Vec3][] => [
  [corner(-1, -1, -1), corner(-1, -1, 1)],
  [corner(-1, -1, 1), corner(1, -1, 1)],
  [corner(-1, -1, 1), corner(-1, 1, 1)],
];

/** Clicks pairs of corners in photos: lengths are within their bounds. Returns the number of lengths. */
async function checkClicks(page: Page, which: readonly number[]): Promise<number> {
  let count = 0;
  for (const keyframe of which) {
    for (const snaps of [true, false]) {
      for (const [a, b] of pairs()) {
        const found = await page.evaluate(
          async ([a, b, which, snaps]) => {
            const { viewer, measuring } = (window as unknown as Viewed).pmspPage;
            viewer.enter(which, true, true);
            await measuring.picking.depths.of(which);
            const points = [a, b].map((at) => {
              const eye = viewer.perspective.position.toArray();
              viewer.lookAlong(at.map((x, i) => x - eye[i]));
              viewer.draw();
              return measuring.picking.at(...viewer.project(at), snaps);
            });
            if (points.some((it) => typeof it === "string" || it.picked.keyframe !== which)) return null;
            return { ...viewer.result({ kind: "distance", points: points.map((it) => it.picked) }), snaps: points.map((it) => it.snap) };
          },
          [a, b, keyframe, snaps] as const,
        );
        if (!found) continue; // the depth map has none there
        const truth = norm(sub(b, a));
        console.log(`# keyframe ${keyframe}, ${found.snaps.join(" and ")}: ${found.text}, truly ${truth}`);
        assert.ok(Math.abs(found.value - truth) <= found.error, `${found.text}, truly ${truth}`);
        ++count;
      }
    }
  }
  return count;
}

test("a click in a photo takes what that keyframe saw there, within its bound", async () => {
  const { page, errors } = await openFile(browser, report, { hash: `view=keyframe&keyframe=${photos()[0]}` });
  assert.ok((await checkClicks(page, photos())) > 0);
  assert.deepEqual(errors, []);
  await page.context().close();
});

test("where the page is served, so does a click in each photo beside it, fetched when it opens; each may be the best", async () => {
  const served = await start(densify, ["serve", report]);
  const beside = data.keyframes.flatMap((k, i) => (k.photo_depths && !k.panorama ? [i] : []));
  const { page, errors } = await openPage(browser, served.url, { hash: `view=keyframe&keyframe=${beside[0]}` });
  const fetched: string[] = [];
  page.on("request", (request) => fetched.push(request.url().replace(/.*\/(\d+)\.depth$/, "$1")));
  assert.ok((await checkClicks(page, beside)) >= 2 * beside.length);
  assert.deepEqual([...new Set(fetched.filter((it) => /^\d+$/.test(it)))], beside.slice(1).map((i) => String(data.keyframes[i]!.id)));
  const best: (number | null)[] = [];
  for (const which of beside) {
    const found: number | null = await page.evaluate(async (which) => {
      const { viewer, measuring } = (window as unknown as Viewed).pmspPage;
      viewer.enter(which, true, true);
      const point = measuring.picking.at(viewer.canvas.clientWidth / 2, viewer.canvas.clientHeight / 2);
      return typeof point === "string" ? null : measuring.picking.bestPhoto(point.picked.position);
    }, which);
    console.log(`# seen from keyframe ${which}, best from ${found}`);
    best.push(found);
  }
  assert.ok(best.every((it) => it !== null) && best.some((it) => beside.includes(it!)), `${best}`);
  assert.deepEqual(errors, []);
  await page.context().close();
  served.child.kill("SIGINT");
  await served.ended;
});

test("what a cut takes away is not clicked, nor what lies behind it", async () => {
  const { page } = await openFile(browser, report, { hash: `view=keyframe&keyframe=${photos()[0]}` });
  await page.click("text=Distance");
  await page.evaluate(() => {
    const { viewer } = (window as unknown as Viewed).pmspPage;
    viewer.state.cut = [null, null, null, null, null, viewer.cloud.low[2] + 0.02 * (viewer.cloud.high[2] - viewer.cloud.low[2])];
    viewer.draw();
  });
  await clickAt(page, corner(-1, 0, 0));
  assert.match(await message(page), /cut away/);
  assert.equal(await page.evaluate(() => (window as unknown as Viewed).pmspPage.viewer.pending.length), 0);
  await page.context().close();
});

test("a double click is one point", async () => {
  const { page } = await openFile(browser, report, { hash: `view=keyframe&keyframe=${photos()[0]}` });
  await page.click("text=Distance");
  await page.locator("#points").dblclick({ position: { x: 500, y: 300 } });
  await page.locator("#points").click({ position: { x: 501, y: 300 } });
  assert.equal(await page.evaluate(() => (window as unknown as Viewed).pmspPage.viewer.pending.length), 1);
  assert.equal(await rows(page), 0);
  await page.context().close();
});

test("a known length scales the page, stays in the address, and its command makes the cloud that large", async () => {
  const { page, errors } = await measured();
  assert.match((await page.textContent("#results tbody")) ?? "", /± .* map units/);
  const height = (): Promise<string> => page.locator("#clip output").textContent().then((text) => text ?? "");
  const unscaled = await height();
  assert.match(unscaled, /map units above the floor$/);
  await page.click("text=Known length");
  page.once("dialog", (dialog) => void dialog.accept("16 m"));
  for (const place of [corner(-1, -1, -1), corner(-1, -1, 1)]) await clickAt(page, place);
  const value = (text: string): number[] => [...text.matchAll(/[\d.]+/g)].map((it) => Number(it[0]));
  const [length = 0, error = 0] = value((await page.textContent("#results tbody td:nth-child(3)")) ?? "");
  assert.ok(Math.abs(length - 16) <= error && error < 2, `${length} ± ${error}`);
  assert.match(await height(), /\d m above the floor$/);
  assert.ok(Math.abs(parseFloat(await height()) / parseFloat(unscaled) - 2) < 0.2, await height());
  await addressWith(page, "length=");
  const { page: again } = await openFile(browser, report, { hash: page.url().split("#")[1] ?? "" });
  assert.equal(await again.textContent("#results"), await page.textContent("#results"));
  const command = (await page.textContent("#results code")) ?? "";
  assert.match(command, /^pmsp-densify convert \S+c\.ply -o metres\.ply --length \S+ \S+ 16$/);
  execFileSync("bash", ["-c", `"$PMSP_DENSIFY" ${command.replace(/^pmsp-densify /, "")}`], { cwd: folder, stdio: "ignore" });
  const header = readFileSync(join(folder, "metres.ply")).subarray(0, 4000).toString("latin1");
  const scale = Number(/scale[^\d\n]*([\d.]+)/.exec(header)?.[1]);
  assert.ok(Math.abs(scale - 2) < 0.2, header.slice(0, 1500));
  await page.selectOption("#results select", "ft");
  const [feet = 0] = value((await page.textContent("#results tbody td:nth-child(3)")) ?? "");
  assert.ok(Math.abs(feet * 0.3048 - length) < 0.1, `${feet} ft`);
  await addressWith(page, "unit=ft");
  await page.click("text=Remove known length");
  assert.match((await page.textContent("#results tbody")) ?? "", /map units/);
  assert.deepEqual(errors, []);
  await page.context().close();
  await again.context().close();
});

test("what is no length is refused and changes nothing", async () => {
  const { page } = await measured();
  const before = await page.textContent("#results");
  await page.click("text=Known length");
  page.once("dialog", (dialog) => void dialog.accept("a door"));
  for (const place of [corner(-1, -1, -1), corner(-1, -1, 1)]) await clickAt(page, place);
  assert.match(await message(page), /"a door" is no length; expected/);
  assert.equal(await page.textContent("#results"), before);
  await page.context().close();
});

test("names, undo and clear, by button and by key", async () => {
  const { page } = await measured();
  await page.fill("#results tbody input", "<b>long side</b>");
  await page.locator("#results tbody input").press("Tab");
  assert.match((await page.evaluate(() => document.activeElement?.getAttribute("aria-label"))) ?? "", /of point 1 of Distance 1$/);
  await page.click("#results >> text=Undo");
  assert.equal(await page.inputValue("#results tbody input"), "");
  await page.fill("#results tbody input", "<b>long side</b>");
  await page.locator("#results tbody input").press("Tab");
  await addressWith(page, "name%3A%3Cb%3Elong");
  const { page: again } = await openFile(browser, report, { hash: page.url().split("#")[1] ?? "" });
  assert.equal(await again.inputValue("#results tbody input"), "<b>long side</b>");
  assert.equal(await again.locator("#results b").count(), 0);
  await again.context().close();
  await page.click("#results >> text=Clear");
  assert.equal(await rows(page), 0);
  await page.click("#results >> text=Undo");
  assert.equal(await page.inputValue("#results tbody input"), "<b>long side</b>");
  await page.focus("#points");
  await page.keyboard.press("x");
  assert.equal(await rows(page), 0);
  await page.keyboard.press("Control+z");
  assert.equal(await rows(page), 1);
  await page.click('[aria-label="Remove Distance 1"]');
  assert.equal(await rows(page), 0);
  assert.equal(await page.evaluate(() => document.activeElement?.textContent), "Undo");
  await page.keyboard.press("Enter");
  assert.equal(await rows(page), 1);
  await page.focus("#points");
  await page.keyboard.press("h");
  await page.keyboard.press("Enter");
  assert.equal(await page.evaluate(() => (window as unknown as Viewed).pmspPage.viewer.pending.length), 1);
  await page.keyboard.press("u");
  assert.match(await message(page), /point is undone; 0 left/);
  await page.context().close();
});

test("by keyboard an area has as many corners as one likes: Enter again ends it", async () => {
  const { page } = await openFile(browser, report, { hash: `view=keyframe&keyframe=${photos()[0]}` });
  await page.focus("#points");
  await page.keyboard.press("r");
  const pending = (): Promise<number> => page.evaluate(() => (window as unknown as Viewed).pmspPage.viewer.pending.length);
  for (let i = 0; i < 40 && (await pending()) < 4; ++i) {
    await page.keyboard.press(i % 3 === 2 ? "ArrowUp" : "ArrowRight");
    await page.keyboard.press("Enter");
  }
  assert.equal(await pending(), 4);
  await page.keyboard.press("Enter");
  assert.equal(await pending(), 0);
  assert.match((await page.textContent("#results tbody tr")) ?? "", /^Area\d.* ± /);
  await page.context().close();
});

test("what the address cannot keep is refused, with a message", async () => {
  const { page } = await measured();
  await page.evaluate(() => {
    const { state } = (window as unknown as Viewed).pmspPage;
    state.measurements = new Array(100).fill(state.measurements[0]);
  });
  await clickAt(page, corner(-1, -1, -1));
  assert.match(await message(page), /at most 100 measurements/);
  assert.equal(await page.evaluate(() => (window as unknown as Viewed).pmspPage.viewer.pending.length), 0);
  await page.context().close();
});

test("a table from an address says what the loaded page does", async () => {
  const { page } = await openFile(browser, report, { hash: "distance=0,0,0,0.5,-1,0;1,0,0,0.5,-1,0" });
  await idle(page);
  const text = await page.evaluate(() => {
    const { viewer } = (window as unknown as Viewed).pmspPage;
    return viewer.result(viewer.state.measurements[0]).text;
  });
  assert.equal(await page.textContent("#results tbody td:nth-child(3)"), text);
  await page.context().close();
});

test("the table is copied and saved as CSV, GeoJSON and DXF, in the shown unit", { skip: skipInFirefox }, async () => {
  const { page, errors } = await measured("&unit=ft");
  await page.focus("#points");
  await page.keyboard.press("y");
  await page.waitForFunction(() => /are copied/.test(document.getElementById("message")?.textContent ?? ""));
  const saved = async (name: string): Promise<string> => {
    const [download] = await Promise.all([page.waitForEvent("download"), page.click(`#results >> text="${name}"`)]);
    assert.equal(download.suggestedFilename(), `measurements.${name.toLowerCase()}`);
    return readFileSync(await download.path(), "utf8");
  };
  const csv = await saved("CSV");
  assert.match(csv.split("\r\n")[0] ?? "", /,wkt_map_units$/); // the scale is unknown: no feet
  const places = /LINESTRING Z \(([^)]*)\)/.exec(csv)![1]!.split(", ").map((p) => p.split(" ").map(Number) as unknown as Vec3);
  assert.ok(norm(sub(places[1]!, places[0]!)) > 7);
  assert.ok(norm(sub(places[0]!, [-half[0], -half[1], -half[2]])) < 0.4, "in the frame of the cloud");
  const geojson = JSON.parse(await saved("GeoJSON"));
  assert.equal(geojson.unit, "map units");
  assert.deepEqual(geojson.features[0].geometry.coordinates, places);
  assert.match(await saved("DXF"), /\$INSUNITS\n70\n0\n[^]*POLYLINE[^]*VERTEX[^]*TEXT[^]*EOF\n$/);
  assert.deepEqual(errors, []);
  await page.context().close();
});

test("the photo that sees a point best opens, turned to it; where none does, the page says so", async () => {
  const { page } = await measured();
  await page.click('[aria-label="Best photo of point 2 of Distance 1"]');
  assert.match(await message(page), /^Keyframe \d+ sees the point best\.$/);
  const off = await page.evaluate(() => {
    const { viewer } = (window as unknown as Viewed).pmspPage;
    viewer.draw();
    const [x, y] = viewer.project(viewer.state.measurements[0].points[1].position);
    return Math.hypot(x - viewer.canvas.clientWidth / 2, y - viewer.canvas.clientHeight / 2);
  });
  assert.ok(off < 2, `${off} px beside the middle`);
  await page.context().close();
  const { page: other } = await openFile(browser, report, { hash: "note=0,0,40;far away" });
  await other.click('[aria-label="Best photo of note 1"]');
  assert.equal(await message(other), "No photo of this page sees that point.");
  await other.context().close();
});

test("points snap to corners, unless Shift is held or snapping is off", async () => {
  const { page } = await openFile(browser, report, { hash: `view=keyframe&keyframe=${photos()[0]}` });
  await page.click("text=Distance");
  const snaps = async (modifiers: "Shift"[] = []): Promise<boolean> => {
    await clickAt(page, corner(-1, -1, 1), modifiers);
    const isSnapped = /on an? (plane|edge|corner)/.test(await message(page));
    await page.focus("#points");
    await page.keyboard.press("u");
    return isSnapped;
  };
  assert.equal(await snaps(), true);
  assert.equal(await snaps(["Shift"]), false);
  await page.keyboard.press("t");
  assert.equal(await page.isChecked("#results input[type=checkbox]"), false);
  assert.equal(await snaps(), false);
  await page.context().close();
});

test("axe finds nothing in a page with measurements, notes and a known length", async () => {
  const { page } = await measured("&note=0,0,0;here&length=0,0,0,1,-1,0;1,0,0,1,-1,0;2,0.1", 1);
  assert.deepEqual(await violations(page), []);
  await page.context().close();
});
