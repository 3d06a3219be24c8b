// SPDX-License-Identifier: BSD-2-Clause
// The page in a real browser. Needs PMSP_DENSIFY and PMSP_SYNTH; exits with 77 where there is no chromium.
import assert from "node:assert/strict";
import { execFileSync, spawnSync } from "node:child_process";
import { cpSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { pathToFileURL } from "node:url";
import type { Browser, Page } from "playwright-core";
import type { ReportData } from "../src/data";
import { type Vec3, add, panoramaPlace, sub, toCamera } from "../src/geometry";
import { pointsOf } from "../src/measure";
import { chromiumPath, idle, openFile, startBrowser, violations } from "./browser";

type Viewed = { pmspPage: any };

if (!chromiumPath() || !process.env["PMSP_DENSIFY"] || !process.env["PMSP_SYNTH"]) {
  console.log("skipped: no chromium, or PMSP_DENSIFY and PMSP_SYNTH are not set");
  process.exit(77);
}

const folder = mkdtempSync(join(tmpdir(), "pmsp-page-"));
// A mission whose names would hurt a page that takes text for HTML.
const evil = join(folder, "<");
const report = join(folder, "report.html");
const dataBegin = '<script type="application/json" id="pmsp-data">';
let browser: Browser;
let data: ReportData;
/** Half of the synthetic room's sides, in metres. */
const half: Vec3 = [3, 1.5, 4];
const corner = (x: number, y: number, z: number): Vec3 => sub([x * half[0], y * half[1], z * half[2]], data.origin);

before(async () => {
  const mission = join(folder, "mission");
  execFileSync(process.env["PMSP_SYNTH"]!, ["--scene", "room", "--width", "1024", "--keyframes", "6", "-o", mission], { stdio: "ignore" });
  mkdirSync(evil);
  mkdirSync(join(evil, "script><img src=x onerror=window.hurt=1>"));
  const map = join(evil, "script><img src=x onerror=window.hurt=1>", "<b>&map.msg");
  cpSync(join(mission, "map.msg"), map);
  execFileSync(
    process.env["PMSP_DENSIFY"]!,
    ["run", map, "--images", join(mission, "images"), "-o", join(folder, "c.ply"), "--report", report]
      .concat(["--quality", "online", "--backend", "cpu", "--width", "640", "--height", "320", "--progress", "none", "--report-panoramas", "3", "--scale", "1"]),
    { stdio: ["ignore", "ignore", "inherit"] },
  );
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

test("it prints with the picture as it was shown, without buttons", async () => {
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
  assert.ok(!(await page.isVisible("#toolbar")) && !(await page.isVisible("#view")));
  assert.ok(await page.isVisible("text=Where the time went"));
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

test("a phone's window holds the page", async () => {
  const { page, errors } = await openFile(browser, report, { width: 390, height: 780, touch: true });
  assert.ok((await page.evaluate(() => document.documentElement.scrollWidth)) <= 390);
  await page.tap("text=Photo >> nth=0");
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

for (const million of [2, 5]) test(`${million} million points are drawn`, async () => {
  const each = 50_000 * million;
  const blocks: string[] = [];
  for (let node = 0; node < 20; ++node) {
    const bytes = Buffer.alloc(15 * each, 160);
    for (let i = 0; i < 6 * each; i += 2) bytes.writeUInt16LE((i * 40503 + node * 7919 + (i >> 3) * 977) & 65535, i);
    blocks.push(`<script type="application/octet-stream" id="pmsp-node-${node}">${bytes.toString("base64")}</script>\n`);
  }
  const many = variant(
    `many${million}`,
    (d) => {
      d.nodes = blocks.map((_, i) => ({ level: i === 0 ? 0 : 1, corner: [(i % 5) - 2.5, Math.floor(i / 5) - 2, -1], side: 1, points: each }));
      d.points = d.points_in = 20 * each;
    },
    blocks.join(""),
  );
  const began = Date.now();
  const { page, errors } = await openFile(browser, many);
  const loaded = Date.now() - began;
  await idle(page);
  const complete = Date.now() - began;
  const box = (await page.locator("#points").boundingBox())!;
  const stepsOf = (): Promise<number> => page.evaluate(() => (window as unknown as Viewed).pmspPage.viewer.frames.steps);
  await page.mouse.move(box.x + 300, box.y + 300);
  await page.mouse.down();
  const before = await stepsOf();
  for (let i = 1; i <= 20; ++i) {
    await page.mouse.move(box.x + 300 + 5 * i, box.y + 300);
    await page.waitForFunction(() => !(window as unknown as Viewed).pmspPage.viewer.frames.isMoved);
  }
  assert.equal(await stepsOf(), before, "a full picture is drawn while a pointer is down");
  const moving = await page.evaluate(() => (window as unknown as Viewed).pmspPage.viewer.frames.shownPoints);
  await page.mouse.up();
  await idle(page);
  const [count, shown, heap] = (await page.evaluate(() => {
    const { viewer } = (window as unknown as Viewed).pmspPage;
    return [viewer.cloud.loaded, viewer.frames.shownPoints, (performance as any).memory.usedJSHeapSize / 2 ** 20];
  })) as [number, number, number];
  console.log(`# ${million} million points: open after ${loaded} ms, complete after ${complete} ms, ${moving} drawn while moving (software rendering), ${heap.toFixed(0)} MiB of JavaScript`);
  assert.ok(shown >= moving, `${shown} ${moving}`);
  assert.equal(count, million * 1_000_000);
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
  assert.equal(requests.length, 1);
  assert.match((await page.textContent("table")) ?? "", /failed.*a <b>\.msg/);
  assert.deepEqual(await violations(page), []);
  await context.close();
});
