// SPDX-License-Identifier: BSD-2-Clause
// The page in a real browser. Needs PMSP_DENSIFY and PMSP_SYNTH; exits with 77 where there is no chromium.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { pathToFileURL } from "node:url";
import type { Browser, Page } from "playwright-core";
import type { ReportData } from "../src/data";
import { type Vec3, add, panoramaPlace, sub, toCamera } from "../src/geometry";
import { pointsOf } from "../src/measure";
import { chromiumPath, idle, openFile, skipInFirefox, startBrowser, violations } from "./browser";
import { roomReport } from "./room";

type Viewed = { pmspPage: any };

if (!chromiumPath() || !process.env["PMSP_DENSIFY"] || !process.env["PMSP_SYNTH"]) {
  console.log("skipped: no chromium, or PMSP_DENSIFY and PMSP_SYNTH are not set");
  process.exit(77);
}

const folder = mkdtempSync(join(tmpdir(), "pmsp-page-"));
let report: string;
const dataBegin = '<script type="application/json" id="pmsp-data">';
let browser: Browser;
let data: ReportData;
/** Half of the synthetic room's sides, in metres. */
const half: Vec3 = [3, 1.5, 4];
const corner = (x: number, y: number, z: number): Vec3 => sub([x * half[0], y * half[1], z * half[2]], data.origin);

before(async () => {
  report = roomReport(folder);
  const text = readFileSync(report, "utf8");
  const begin = text.indexOf(dataBegin) + dataBegin.length;
  data = JSON.parse(text.slice(begin, text.indexOf("</script>", begin))) as ReportData;
  browser = await startBrowser();
});

after(async () => {
  await browser?.close();
  rmSync(folder, { recursive: true });
});

const lightPixels = (page: Page): Promise<number> =>
  page.evaluate(() => {
    const { viewer } = (window as unknown as Viewed).pmspPage;
    const gl = viewer.renderer.getContext();
    viewer.draw();
    const [w, h] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
    const bytes = new Uint8Array(4 * w * h);
    gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    let light = 0;
    for (let i = 0; i < bytes.length; i += 4) light += bytes[i]! + bytes[i + 1]! + bytes[i + 2]! > 120 ? 1 : 0;
    return light / (w * h);
  });

/** A page with other data. */
function variant(name: string, change: (d: ReportData) => void, blocks = ""): string {
  const text = readFileSync(report, "utf8");
  const begin = text.indexOf(dataBegin) + dataBegin.length;
  const end = text.indexOf("</script>", begin);
  const changed = JSON.parse(text.slice(begin, end)) as ReportData;
  change(changed);
  const rest = text.slice(end + "</script>".length).replace(/<script type="application\/octet-stream" id="pmsp-node-\d+">[^<]*<\/script>\n?/g, "");
  const path = join(folder, `${name}.html`);
  writeFileSync(path, `${text.slice(0, begin)}${JSON.stringify(changed).replaceAll("<", "\\u003c")}</script>${blocks}${rest}`);
  return path;
}

test("the page opens from disk, asks nobody for anything, and takes no name for HTML", async () => {
  const { page, requests, errors } = await openFile(browser, report);
  assert.deepEqual(requests, []);
  assert.deepEqual(errors, []);
  assert.equal(await page.evaluate(() => (window as unknown as { hurt?: number }).hurt), undefined);
  assert.equal(await page.title(), "<b>&map.msg: report");
  assert.match((await page.textContent("#report")) ?? "", /script><img src=x/);
  assert.equal(await page.locator("#report b, #title b").count(), 0);
  assert.ok((await lightPixels(page)) > 0.1);
  assert.ok((await page.locator(".strips img").count()) >= 3);
  assert.ok(await page.evaluate(() => [...document.images].every((i) => i.id === "print" || i.complete)));
  await page.context().close();
});

test("what is measured between the room's corners is true within the error that is told", async () => {
  const { page } = await openFile(browser, report, { hash: "view=keyframe&keyframe=2" });
  const pairs: [string, Vec3, Vec3][] = [
    ["length", corner(-1, -1, -1), corner(-1, -1, 1)],
    ["width", corner(-1, -1, 1), corner(1, -1, 1)],
    ["height", corner(-1, -1, 1), corner(-1, 1, 1)],
    ["diagonal", corner(1, -1, 1), corner(-1, -1, -1)],
  ];
  for (const [name, a, b] of pairs) {
    const found = await page.evaluate(
      ([a, b, kind]) => {
        const { viewer } = (window as unknown as Viewed).pmspPage;
        const points = [a, b].map((at: Vec3) => {
          const eye = viewer.perspective.position.toArray();
          viewer.lookAlong([at[0] - eye[0], at[1] - eye[1], at[2] - eye[2]]);
          viewer.draw();
          const [x, y] = viewer.project(at);
          return viewer.pick(x, y);
        });
        return points.every((p) => p) ? viewer.result({ kind, points }) : null;
      },
      [a, b, name === "height" ? "height" : "distance"] as const,
    );
    assert.ok(found, name);
    const truth = Math.hypot(...sub(b, a));
    console.log(`# ${name}: ${found.text}, truly ${truth.toFixed(3)}`);
    assert.ok(Math.abs(found.value - truth) <= found.error, `${name}: ${found.text}, truly ${truth}`);
    assert.ok(found.error < 0.2 * truth, `${name}: the error that is told is too large: ${found.text}`);
  }
  await page.context().close();
});

test("clicks measure, and the address keeps it", async () => {
  const { page } = await openFile(browser, report, { hash: "view=walk&keyframe=2" });
  await page.click("text=Distance");
  await page.mouse.click(400, 400);
  await page.mouse.click(600, 420);
  await page.waitForSelector("#results tbody tr");
  assert.match((await page.textContent("#results tbody tr")) ?? "", /Distance\d.* ± \d.* m/);
  await page.waitForFunction(() => location.hash.includes("distance="));
  const address = page.url();
  assert.match(address, /distance=/);
  const { page: again } = await openFile(browser, report, { hash: address.split("#")[1] ?? "" });
  assert.equal(await again.textContent("#results tbody tr"), await page.textContent("#results tbody tr"));
  assert.equal(pointsOf.distance, 2);
  await page.context().close();
  await again.context().close();
});

test("colours change what is drawn, by key and by list", async () => {
  const { page } = await openFile(browser, report);
  const picture = () => page.evaluate(() => (window as unknown as Viewed).pmspPage.viewer.picture().toDataURL());
  const seen = new Set<string>([await picture()]);
  for (const name of ["height", "confidence", "views", "normal"]) {
    await page.selectOption("select", name);
    seen.add(await picture());
  }
  assert.equal(seen.size, 5);
  await page.focus("#points");
  await page.keyboard.press("c");
  assert.equal(await page.inputValue("select"), "photo");
  await page.keyboard.press("2");
  assert.equal(await page.getAttribute("text=Plan", "aria-pressed"), "true");
  await page.context().close();
});

test("a keyframe's photo fits the points within 2 pixels", async () => {
  const which = data.keyframes.findIndex((k) => k.panorama);
  const { page } = await openFile(browser, report, { hash: `view=keyframe&keyframe=${which}&fade=0` });
  const keyframe = data.keyframes[which]!;
  const marks = [corner(1, 1, 1), corner(-1, 1, 1), corner(1, -1, -1), corner(-1, -1, 1)];
  for (const mark of marks) {
    const ray = toCamera(keyframe, sub(add(mark, data.origin), keyframe.center));
    const off = await page.evaluate(
      async ([mark, place, which]) => {
        const { viewer } = (window as unknown as Viewed).pmspPage;
        const canvas = document.createElement("canvas");
        canvas.width = 4096;
        canvas.height = 2048;
        const context = canvas.getContext("2d")!;
        context.fillStyle = "#000";
        context.fillRect(0, 0, 4096, 2048);
        context.fillStyle = "#fff";
        context.beginPath();
        context.arc(place[0]! * 4096, place[1]! * 2048, 8, 0, 7);
        context.fill();
        viewer.panorama.show(canvas.toDataURL("image/png"), viewer.data.keyframes[which]);
        while (!viewer.panorama.ready) await new Promise((done) => setTimeout(done, 20));
        const eye = viewer.perspective.position.toArray();
        // Not in the middle, where an error of the projection would not show.
        viewer.lookAlong([mark[0] - eye[0] + 0.6, mark[1] - eye[1] + 0.4, mark[2] - eye[2] + 0.3]);
        viewer.draw();
        const gl = viewer.renderer.getContext();
        const [w, h] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
        const bytes = new Uint8Array(4 * w * h);
        gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
        let [sum, x, y] = [0, 0, 0];
        for (let i = 0; i < w * h; ++i) {
          if (bytes[4 * i]! < 128) continue;
          sum += 1;
          x += (i % w) + 0.5;
          y += h - Math.floor(i / w) - 0.5;
        }
        const [px, py] = viewer.project(mark);
        return sum > 0 ? Math.hypot(x / sum - px, y / sum - py) : 1e9;
      },
      [mark, panoramaPlace(ray), which] as const,
    );
    console.log(`# off by ${off.toFixed(2)} px`);
    assert.ok(off < 2, `the photo is ${off} pixels off`);
  }
  await page.context().close();
});

test("it prints with the picture as it was shown, without buttons", { skip: skipInFirefox }, async () => {
  const { page, errors } = await openFile(browser, report, { hash: "view=walk" });
  const pdf = await page.pdf();
  assert.equal(pdf.subarray(0, 5).toString(), "%PDF-");
  assert.ok(pdf.length > 50_000, `${pdf.length} bytes`);
  await page.emulateMedia({ media: "print" });
  const size = await page.evaluate(() => {
    window.dispatchEvent(new Event("beforeprint"));
    const print = document.getElementById("print") as HTMLImageElement;
    return print.decode().then(() => [print.naturalWidth, print.getBoundingClientRect().width]);
  });
  assert.ok(size.every((x) => x > 500), `${size}`);
  for (const hidden of ["#toolbar", "#view", "#results >> text=Undo"]) assert.ok(!(await page.isVisible(hidden)), hidden);
  assert.ok(await page.isVisible("text=Where the time went"));
  await page.setViewportSize({ width: 600, height: 800 }); // as narrow as Firefox makes a sheet
  assert.ok(await page.isVisible("#subtitle"));
  assert.deepEqual(errors, []);
  await page.context().close();
});

test("a lost GL context comes back", async () => {
  const { page, errors } = await openFile(browser, report);
  const light = await lightPixels(page);
  await page.evaluate(async () => {
    const gl = (window as unknown as Viewed).pmspPage.viewer.renderer.getContext();
    const extension = gl.getExtension("WEBGL_lose_context");
    extension.loseContext();
    await new Promise((done) => setTimeout(done, 200));
    extension.restoreContext();
    await new Promise((done) => setTimeout(done, 500));
  });
  assert.ok(Math.abs((await lightPixels(page)) - light) < 0.01);
  assert.deepEqual(errors.filter((text) => !/context/i.test(text)), []);
  await page.context().close();
});

test("a phone's window holds the page", { skip: skipInFirefox }, async () => {
  const { page, errors } = await openFile(browser, report, { width: 390, height: 780, touch: true });
  assert.ok((await page.evaluate(() => document.documentElement.scrollWidth)) <= 390);
  await page.tap("text=Photo >> nth=0");
  const slider = (await page.locator("#flight input").boundingBox())!;
  assert.ok(slider.x > 0 && slider.x + slider.width < 390, JSON.stringify(slider));
  assert.ok((await lightPixels(page)) > 0.1);
  assert.deepEqual(errors, []);
  await page.context().close();
});

test("a cloud without points is told", async () => {
  const empty = variant("empty", (d) => {
    d.nodes = [];
    d.points = d.points_in = 0;
  });
  const { page, errors } = await openFile(browser, empty);
  assert.equal(await page.textContent("#message"), "There are no points.");
  await page.click("text=Plan");
  await page.click("text=Flight");
  assert.deepEqual(errors, []);
  await page.context().close();
});

/** A page with 5 million points, the most that --report-points allows, in 200 cubes. */
function largestPage(): string {
  const [cubes, each] = [200, 25_000];
  const blocks: string[] = [];
  for (let node = 0; node < cubes; ++node) {
    const bytes = Buffer.alloc(15 * each, 160);
    for (let i = 0; i < 6 * each; i += 2) bytes.writeUInt16LE((i * 40503 + node * 7919 + (i >> 3) * 977) & 65535, i);
    blocks.push(`<script type="application/octet-stream" id="pmsp-node-${node}">${bytes.toString("base64")}</script>\n`);
  }
  const change = (d: ReportData): void => {
    const corner = (i: number): Vec3 => [(i % 10) / 2 - 2.5, Math.floor((i % 100) / 10) / 2 - 2.5, Math.floor(i / 100) / 2];
    d.nodes = blocks.map((_, i) => ({ level: i === 0 ? 0 : 1, corner: corner(i), side: 0.5, points: each }));
    d.points = d.points_in = cubes * each;
  };
  return variant("largest", change, blocks.join(""));
}

test("of 5 million points fewer are drawn while a pointer is down, until frames are fluent, and all once it rests", { skip: skipInFirefox }, async () => {
  const file = largestPage();
  const began = Date.now();
  const { page, errors } = await openFile(browser, file, { width: 700, height: 600 });
  await idle(page);
  const complete = Date.now() - began;
  const devtools = await page.context().newCDPSession(page);
  await devtools.send("Emulation.setCPUThrottlingRate", { rate: 4 });
  const heap = await page.evaluate(() => {
    const { pace } = (window as unknown as Viewed).pmspPage.viewer.frames;
    pace.budget = 5_000_000; // as if frames had been fast until now
    const took = pace.took.bind(pace);
    const frames: [number, number][] = ((window as any).frames = []);
    pace.took = (points: number, time: number) => {
      frames.push([points, time]);
      took(points, time);
    };
    return (performance as any).memory.usedJSHeapSize / 2 ** 20;
  });
  const drawn = (): Promise<{ shown: number; steps: number; isIdle: boolean }> =>
    page.evaluate(() => {
      const { shownPoints: shown, steps, isIdle } = (window as unknown as Viewed).pmspPage.viewer.frames;
      return { shown, steps, isIdle };
    });
  const box = (await page.locator("#points").boundingBox())!;
  await page.mouse.move(box.x + 200, box.y + 200);
  await page.mouse.down();
  const { steps } = await drawn();
  const frames: [number, number][] = [];
  const isFluent = ([points, time]: [number, number]): boolean => time < 60 || points <= 50_000;
  do {
    await page.mouse.move(box.x + 200 + 5 * frames.length + 5, box.y + 200);
    await page.waitForFunction((count) => (window as any).frames.length > count, frames.length);
    frames.push((await page.evaluate(() => (window as any).frames.at(-1))) as [number, number]);
  } while (frames.length < 40 && !isFluent(frames.at(-1)!));
  console.log(`# complete after ${complete} ms, ${heap.toFixed(0)} MiB of JavaScript; while moving ${frames.map(([points, time]) => `${points} in ${time.toFixed(0)} ms`).join(", ")}`);
  assert.ok(isFluent(frames.at(-1)!), "frames do not become fluent");
  assert.ok(frames.at(-1)![0] < 0.5 * frames[0]![0]);
  await page.waitForTimeout(500); // longer than the rest that a full picture waits for
  const held = await drawn();
  assert.equal(held.steps, steps, "a full picture is drawn while a pointer is down");
  assert.ok(!held.isIdle && held.shown < 0.5 * 5_000_000);
  await page.mouse.up();
  await idle(page);
  assert.equal((await drawn()).shown, 5_000_000);
  assert.deepEqual(errors, []);
  await page.context().close();
});

test("axe finds nothing that keeps people out", async () => {
  for (const hash of ["", "view=keyframe&color=confidence", "view=plan"]) {
    const { page } = await openFile(browser, report, { hash });
    assert.deepEqual(await violations(page), [], hash);
    await page.context().close();
  }
});

test("axe finds nothing in the page of a batch, which asks nobody for anything", async () => {
  const results = join(folder, "results");
  writeFileSync(join(folder, "m.jsonl"), '{"name": "a", "map": "a <b>.msg", "images": "none"}\n');
  const batch = spawnSync(process.env["PMSP_DENSIFY"]!, ["batch", join(folder, "m.jsonl"), "-o", results, "--quiet"]);
  assert.equal(batch.status, 8); // the only mission has no map
  const context = await browser.newContext();
  const page = await context.newPage();
  const requests: string[] = [];
  page.on("request", (request) => requests.push(request.url()));
  await page.goto(pathToFileURL(join(results, "index.html")).href);
  assert.deepEqual(requests.filter((url) => url !== page.url()), []);
  assert.match((await page.textContent("table")) ?? "", /failed.*a <b>\.msg/);
  assert.deepEqual(await violations(page), []);
  await context.close();
});
