// SPDX-License-Identifier: BSD-2-Clause
// Views, storeys and navigation in a building of two storeys (building.ts). Exits with 77 where there is no chromium.
import assert from "node:assert/strict";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import type { Browser, Page } from "playwright-core";
import { chromiumPath, idle, openFile, skipInFirefox, startBrowser, violations } from "./browser";
import { buildingPage, kEyeHeight, kFloors, kSides, kTurn } from "./building";

if (!chromiumPath()) {
  console.log("skipped: no chromium");
  process.exit(77);
}

const folder = mkdtempSync(join(tmpdir(), "pmsp-views-"));
const report = join(folder, "report.html");
let browser: Browser;

before(async () => {
  writeFileSync(report, buildingPage(45_000));
  browser = await startBrowser();
});

after(async () => {
  await browser?.close();
  rmSync(folder, { recursive: true });
});

const open = async (hash: string, size: { width?: number; height?: number; touch?: boolean } = {}): Promise<Page> => {
  const { page } = await openFile(browser, report, { hash, ...size });
  await idle(page);
  return page;
};
const state = (page: Page): Promise<any> => page.evaluate(() => (window as any).pmspPage.state);
const keyframeOf = (page: Page): Promise<number> => page.evaluate(() => (window as any).pmspPage.state.keyframe);
const eyeOf = async (page: Page): Promise<number[]> => (await state(page)).eye;
const distance = (a: number[], b: number[]): number => Math.hypot(...a.map((x, i) => x - b[i]!));
const press = async (page: Page, key: string): Promise<void> => {
  await page.focus("#points");
  await page.keyboard.press(key);
  await idle(page);
};
/** Where rings are in the window. */
const ringsOf = async (page: Page): Promise<{ keyframe: number; x: number; y: number }[]> => {
  const box = (await page.locator("#points").boundingBox())!;
  const rings = (await page.evaluate(() => (window as any).pmspPage.viewer.overlay.rings)) as { keyframe: number; x: number; y: number }[];
  return rings.map((it) => ({ keyframe: it.keyframe, x: it.x + box.x, y: it.y + box.y }));
};

/** Shares of the frame between the outermost lit columns and rows; 1 % of the lit pixels at either end do not count. */
const filled = (page: Page): Promise<[number, number]> =>
  page.evaluate(() => {
    const { viewer } = (window as any).pmspPage;
    const gl = viewer.renderer.getContext();
    viewer.draw();
    const [w, h] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
    const bytes = new Uint8Array(4 * w * h);
    gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    const [xs, ys]: [number[], number[]] = [[], []];
    for (let i = 0; i < w * h; ++i) {
      if (bytes[4 * i]! + bytes[4 * i + 1]! + bytes[4 * i + 2]! < 150) continue;
      xs.push(i % w);
      ys.push(Math.floor(i / w));
    }
    const span = (values: number[], size: number): number => {
      values.sort((a, b) => a - b);
      return (values[Math.floor(0.99 * values.length)]! - values[Math.floor(0.01 * values.length)]!) / size;
    };
    return [span(xs, w), span(ys, h)] as [number, number];
  });

test("the first view is filled by the building, straightened to its walls, whatever strays around it", async () => {
  for (const [hash, size] of [["", {}], ["view=plan", {}], ["", { width: 500, height: 900 }]] as const) {
    const page = await open(hash, size);
    const [wide, tall] = await filled(page);
    console.log(`# ${hash || "around"}: ${wide.toFixed(2)} x ${tall.toFixed(2)} of the frame`);
    assert.ok(Math.max(wide, tall) > 0.75 && Math.max(wide, tall) < 0.93, `${hash}: ${wide} ${tall}`);
    const along = (await page.evaluate(() => (window as any).pmspPage.viewer.basis[0])) as number[];
    const off = (Math.atan2(along[1]!, along[0]!) - kTurn) / (Math.PI / 2);
    assert.ok(Math.abs(off - Math.round(off)) < 0.01, `turned by ${off * 90} degrees`);
    await page.context().close();
  }
});

test("every view has a scale bar, and the path shows where keyframes are", async () => {
  for (const hash of ["", "view=plan", "view=walk&keyframe=3"]) {
    const page = await open(hash);
    await page.waitForFunction(() => (window as any).pmspPage.viewer.overlay.scaleBar() !== null);
    const text = (await page.evaluate(() => (window as any).pmspPage.viewer.overlay.scaleBar().text)) as string;
    assert.match(text, hash === "view=plan" ? /^\d+ m$/ : /^[\d.]+ m at [\d.]+ m$/);
    assert.ok((await ringsOf(page)).length >= 3, hash);
    await page.context().close();
  }
  const page = await open("view=walk&keyframe=3", { width: 800 });
  const [view, flight] = [(await page.locator("#view").boundingBox())!, (await page.locator("#flight").boundingBox())!];
  assert.ok(flight.y + flight.height < view.y + view.height - 45, "the scale bar is covered");
  await page.context().close();
});

test("the storeys are found, and one can be shown alone", async () => {
  const page = await open("view=plan");
  const found = (await page.evaluate(() => (window as any).pmspPage.viewer.trajectory.storeys)) as { floor: number; camera: number }[];
  assert.equal(found.length, 2);
  found.forEach((it, i) => {
    assert.ok(Math.abs(it.floor - kFloors[i]!) < 0.1, `${it.floor}`);
    assert.ok(Math.abs(it.camera - kFloors[i]! - kEyeHeight) < 0.1, `${it.camera}`);
  });
  await page.click("#cuts summary");
  await page.selectOption("#clip select", { label: "Storey 2" });
  await idle(page);
  const [low, high] = (await state(page)).cut.slice(4) as (number | null)[];
  assert.ok(low! > 2 && low! < kFloors[1] && high === null, `${low} ${high}`);
  // What is cut away cannot be clicked, either.
  const picked = (await page.evaluate(() => {
    const { viewer } = (window as any).pmspPage;
    return viewer.pick(viewer.width / 2 + 40, viewer.height / 2 + 90);
  })) as { position: number[] };
  assert.ok(picked.position[2]! > 2.5, `${picked.position}`);
  // The small plan follows to another storey.
  await page.click("text=Flight");
  for (const which of [3, 12]) {
    await page.evaluate((which) => (window as any).pmspPage.viewer.tour.goTo(which), which);
    await idle(page);
    const [drawn, now] = await page.evaluate(() => [(window as any).pmspPage.minimap.heights, (window as any).pmspPage.viewer.planHeights]);
    assert.deepEqual(drawn, now);
    assert.equal(now[0] > 2, which === 12);
  }
  await page.context().close();
});

test("a slice lies at the height of the cameras, says so, follows its slider, and stays where it is", async () => {
  const page = await open("");
  await page.click("#cuts summary");
  await page.click("#clip button:text('Slice')");
  const text = (): Promise<string | null> => page.textContent("#clip output");
  assert.match((await text()) ?? "", /^1\.(4[5-9]|5\d?) m above the floor$/);
  await page.locator("#clip input").first().fill("0.8");
  assert.match((await text()) ?? "", /^0\.(79|8)\d* m above the floor$/);
  const { cut } = await state(page);
  assert.ok(Math.abs((cut[4] + cut[5]) / 2 - 0.8) < 0.01, `${cut}`);
  await page.click("text=Flight");
  await page.click("text=Plan");
  assert.deepEqual((await state(page)).cut, cut);
  await page.waitForFunction(() => location.hash.includes("cut="));
  const again = await open(page.url().split("#")[1]!);
  const back = (await state(again)).cut as number[];
  assert.ok(Math.abs(back[4]! - cut[4]) < 1e-4 && Math.abs(back[5]! - cut[5]) < 1e-4);
  for (const it of [page, again]) await it.context().close();
});

test("an address of old, with a cut in shares, shows the same", async () => {
  const page = await open("clip=0.25,0.75,0,1,0,0.5");
  const [cut, low, high, along] = (await page.evaluate(() => {
    const { state, viewer } = (window as any).pmspPage;
    return [state.cut, viewer.cloud.low, viewer.cloud.high, viewer.basis[0]];
  })) as [(number | null)[], number[], number[], number[]];
  assert.deepEqual(cut.map((x) => x === null), [false, false, true, true, true, false]);
  assert.ok(Math.abs(cut[0]! - (0.75 * low[0]! + 0.25 * high[0]!)) < 1e-6);
  assert.ok(Math.abs(cut[5]! - (low[2]! + high[2]!) / 2) < 1e-6);
  assert.ok(along[2] === 0);
  await page.context().close();
});

test("rings go to their keyframes: from outside, and from keyframe to keyframe", async () => {
  const page = await open("");
  const one = (await ringsOf(page)).find((it) => it.keyframe === 12)!;
  await page.mouse.click(one.x, one.y);
  await idle(page);
  assert.equal((await state(page)).mode, "walk");
  assert.equal(await keyframeOf(page), 12);
  const before = await eyeOf(page);
  const next = (await ringsOf(page))[0]!;
  await page.mouse.click(next.x, next.y);
  await idle(page);
  assert.equal(await keyframeOf(page), next.keyframe);
  assert.ok(distance(before, await eyeOf(page)) > 0.5);
  await page.context().close();
});

test("N and B mark keyframes from outside without moving what is seen, and go to them in flight", async () => {
  for (const hash of ["", "view=plan"]) {
    const page = await open(hash);
    const eye = await eyeOf(page);
    await press(page, "n");
    await press(page, "n");
    await press(page, "b");
    assert.equal(await keyframeOf(page), 1);
    assert.deepEqual(await eyeOf(page), eye);
    assert.equal(await page.evaluate(() => (window as any).pmspPage.viewer.overlay.trail().label), "keyframe 1");
    // One that is out of the picture is brought into it.
    for (let i = 0; i < 6; ++i) await press(page, "+");
    await page.evaluate(() => (window as any).pmspPage.viewer.cameras.walk([3, 0, 0]));
    await press(page, "n");
    const [inside, mode] = (await page.evaluate(() => {
      const { viewer, state } = (window as any).pmspPage;
      return [viewer.cameras.isInPicture(viewer.trajectory.centerOf(viewer.data.keyframes[2]), 0), state.mode];
    })) as [boolean, string];
    assert.ok(inside);
    assert.equal(mode, hash === "" ? "orbit" : "plan");
    await page.context().close();
  }
  const page = await open("view=walk&keyframe=3");
  await press(page, "n");
  assert.equal(await keyframeOf(page), 4);
  await page.context().close();
});

test("W, A, S and D move, a double click sets the pivot, and the wheel comes nearer to the cursor", { skip: skipInFirefox }, async () => {
  for (const hash of ["", "view=plan", "view=walk&keyframe=3"]) {
    const page = await open(hash);
    const eye = await eyeOf(page);
    await press(page, "w");
    const ahead = await eyeOf(page);
    await press(page, "s");
    assert.ok(distance(eye, ahead) > 0.01, hash);
    await press(page, "a");
    assert.ok(distance(ahead, await eyeOf(page)) > 0.01, hash);
    await page.context().close();
  }
  const page = await open("");
  const box = (await page.locator("#points").boundingBox())!;
  const at = (): Promise<number[]> => page.evaluate(() => (window as any).pmspPage.viewer.pick(640, 330).position);
  const place = await at();
  await page.mouse.dblclick(box.x + 640, box.y + 330);
  await idle(page);
  assert.ok(distance((await state(page)).target, place) < 0.05);
  await page.click("text=Flight");
  await idle(page);
  const under = (): Promise<number[]> =>
    page.evaluate(() => {
      const { viewer } = (window as any).pmspPage;
      const { position } = viewer.pick(700, 250);
      return viewer.project(position);
    });
  const seen = (await page.evaluate(() => (window as any).pmspPage.viewer.pick(700, 250).position)) as number[];
  await page.mouse.move(box.x + 700, box.y + 250);
  await page.mouse.wheel(0, -600);
  await page.waitForFunction(() => (window as any).pmspPage.viewer.perspective.fov < 50);
  await idle(page);
  const stays = (await page.evaluate((seen) => (window as any).pmspPage.viewer.project(seen), seen)) as number[];
  assert.ok(distance(stays, [700, 250]) < 25, `${stays}, ${await under()}`);
  await page.context().close();
});

test("a plan prints at 1 : 100", { skip: skipInFirefox }, async () => {
  const page = await open("view=plan");
  await page.emulateMedia({ media: "print" });
  const [wide, tall] = (await page.evaluate(async () => {
    window.dispatchEvent(new Event("beforeprint"));
    const print = document.getElementById("print") as HTMLImageElement;
    await print.decode();
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [print.naturalWidth, print.naturalHeight];
    const context = canvas.getContext("2d")!;
    context.drawImage(print, 0, 0);
    const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
    const [xs, ys]: [number[], number[]] = [[], []];
    // The floor is brown; nothing else is.
    for (let i = 0; i < data.length; i += 4) {
      if (data[i]! < 110 || data[i]! - data[i + 2]! < 40 || data[i]! - data[i + 1]! > 60) continue;
      xs.push((i / 4) % canvas.width);
      ys.push(Math.floor(i / 4 / canvas.width));
    }
    const span = (values: number[]): number => {
      values.sort((a, b) => a - b);
      return values[Math.floor(0.999 * values.length)]! - values[Math.floor(0.001 * values.length)]!;
    };
    const millimetres = ((print.getBoundingClientRect().width / 96) * 25.4) / canvas.width;
    return [span(xs) * millimetres, span(ys) * millimetres];
  })) as [number, number];
  console.log(`# floor of ${kSides[0]} x ${kSides[1]} m: ${wide.toFixed(1)} x ${tall.toFixed(1)} mm`);
  assert.ok(Math.abs(wide - 10 * kSides[0]) < 2 && Math.abs(tall - 10 * kSides[1]) < 2, `${wide} ${tall}`);
  await page.context().close();
});

test("a page in feet takes known lengths in feet, and shows metres or feet", async () => {
  const inFeet = join(folder, "feet.html");
  writeFileSync(inFeet, buildingPage(5_000, (data) => (data.unit = "ft")));
  const { page } = await openFile(browser, inFeet);
  page.once("dialog", (dialog) => void dialog.accept("6.6"));
  const metres = (await page.evaluate(() => {
    const { measuring, state } = (window as any).pmspPage;
    measuring.calibrate([0, 1].map((x) => ({ position: [x, 0, 0], confidence: 1, keyframe: -1, spread: 0 })));
    return state.calibration.metres;
  })) as number;
  assert.ok(Math.abs(metres - 6.6 * 0.3048) < 1e-9, `${metres}`);
  const units: string[] = [];
  for (const unit of ["ft", "m"]) {
    await page.selectOption("#results select", unit);
    units.push(await page.evaluate(() => (window as any).pmspPage.viewer.scale.unit));
  }
  assert.deepEqual(units, ["ft", "m"]);
  await page.context().close();
});

test("north is shown where it is known", async () => {
  const whitePixels = (page: Page): Promise<number> =>
    page.evaluate(() => {
      const { data } = (window as any).pmspPage.viewer.overlay.canvas.getContext("2d").getImageData(10, 10, 60, 60);
      return [...data.keys()].filter((i) => i % 4 === 0 && data[i] > 250 && data[i + 3] === 255).length;
    });
  assert.equal(await whitePixels(await open("view=plan")), 0);
  const known = join(folder, "north.html");
  writeFileSync(known, buildingPage(20_000, (data) => (data.north = [0, 1, 0])));
  const { page } = await openFile(browser, known, { hash: "view=plan" });
  await idle(page);
  assert.ok((await whitePixels(page)) > 50);
  await page.context().close();
});

test("a phone has one row of tools, a sheet from below, and targets for fingers", { skip: skipInFirefox }, async () => {
  const page = await open("view=walk&keyframe=3", { width: 390, height: 780, touch: true });
  assert.ok((await page.evaluate(() => document.documentElement.scrollWidth)) <= 390);
  const row = (await page.locator("#toolbar").boundingBox())!;
  assert.ok(row.height < 60 && row.width <= 390, `${row.width} x ${row.height}`);
  assert.ok(!(await page.isVisible("text=Distance")));
  await page.tap("#sheet-button");
  const sheet = (await page.locator("#tools").boundingBox())!;
  assert.ok(Math.abs(sheet.y + sheet.height - 780) < 1 && sheet.y > 250, `${sheet.y} + ${sheet.height}`);
  const small = await page.evaluate(() =>
    [...document.querySelectorAll("#stage button, #stage select, #stage summary, #stage input")]
      .map((it) => [it.textContent, it.getBoundingClientRect()] as const)
      .filter(([, box]) => box.width > 0 && Math.min(box.height, box.width) < 43.5)
      .map(([text, box]) => `${text} ${box.width} x ${box.height}`),
  );
  assert.deepEqual(small, []);
  assert.deepEqual(await violations(page), []);
  await page.tap("text=Distance");
  assert.ok(!(await page.isVisible("text=Distance")));
  await page.tap("[aria-label='Full screen']");
  await page.waitForSelector("#stage.full");
  const full = (await page.locator("#stage").boundingBox())!;
  assert.ok(full.height > 770 && full.width >= 390);
  await page.context().close();
});
