// SPDX-License-Identifier: BSD-2-Clause
// Pictures of the page against those in tests/screens, with tolerance: they come from another processor's points and
// another version's software rendering. PMSP_SCREENS=write writes them anew. Needs PMSP_DENSIFY and PMSP_SYNTH; exits
// with 77 where there is no chromium.
import assert from "node:assert/strict";
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import type { Browser } from "playwright-core";
import { chromiumPath, difference, idle, openFile, startBrowser } from "./browser";
import { roomReport } from "./room";

const { PMSP_DENSIFY: densify, PMSP_SYNTH: synth, PMSP_SCREENS: mode } = process.env;
if (!chromiumPath() || !densify || !synth) {
  console.log("skipped: no chromium, or PMSP_DENSIFY and PMSP_SYNTH are not set");
  process.exit(77);
}

const screens = join(process.cwd(), "tests", "screens");
const folder = mkdtempSync(join(tmpdir(), "pmsp-screens-"));
let report: string;
let browser: Browser;

before(async () => {
  report = roomReport(folder);
  browser = await startBrowser();
});

after(async () => {
  await browser?.close();
  rmSync(folder, { recursive: true });
});

const hashes: Record<string, string> = {
  around: "",
  plan: "view=plan&color=height",
  flight: "view=walk&keyframe=2&color=confidence",
  photo: "view=keyframe&keyframe=0&fade=0.3",
};

for (const [name, hash] of Object.entries(hashes)) {
  test(`the picture "${name}" looks as it did`, async () => {
    const { page } = await openFile(browser, report, { hash, width: 640, height: 480 });
    await idle(page);
    const picture = await page.locator("#view").screenshot({ type: "png" });
    const file = join(screens, `${name}.jpg`);
    if (mode === "write") writeFileSync(file, await page.locator("#view").screenshot({ type: "jpeg", quality: 60 }));
    assert.ok(existsSync(file), `${file} is missing; PMSP_SCREENS=write makes it`);
    const off = await difference(page, picture, readFileSync(file));
    console.log(`# ${name}: mean difference ${off.mean.toFixed(4)}, ${(100 * off.far).toFixed(2)} % of the blocks differ`);
    const told = join(tmpdir(), `pmsp-screen-${name}.png`);
    const isSame = off.size === "" && off.mean < 0.02 && off.far < 0.03;
    if (!isSame) writeFileSync(told, picture);
    assert.ok(isSame, `it is not ${file} (${off.size || `mean ${off.mean}, ${off.far} of the blocks`}); it is in ${told}`);
    await page.context().close();
  });
}

test("another colouring is another picture", async () => {
  const { page } = await openFile(browser, report, { hash: "color=normal", width: 640, height: 480 });
  await idle(page);
  const off = await difference(page, await page.locator("#view").screenshot({ type: "png" }), readFileSync(join(screens, "around.jpg")));
  assert.ok(off.mean > 0.02 && off.far > 0.03, `mean ${off.mean}, ${off.far} of the blocks`);
  await page.context().close();
});
