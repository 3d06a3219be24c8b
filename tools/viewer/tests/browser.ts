// SPDX-License-Identifier: BSD-2-Clause
// Opens pages in the system's chromium, or in Firefox: PMSP_FIREFOX=/usr/bin/firefox-esr, with a display (xvfb-run).
import { existsSync, readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { pathToFileURL } from "node:url";
import { type Browser, type Page, chromium, firefox } from "playwright-core";

export const chromiumPath = (): string | undefined =>
  [process.env["PMSP_CHROMIUM"], "/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"].find(
    (path) => path && existsSync(path),
  );

const firefoxPath = process.env["PMSP_FIREFOX"];
/** Reason to skip a test of what cannot be driven there: touch, double clicks, print, downloads, a slower processor. */
export const skipInFirefox = firefoxPath ? "not in Firefox" : false;

/** Mesa's software rendering takes half the time of Chromium's own, which needs no package. */
const kRenderers = [
  ["--use-angle=gl-egl", "--ignore-gpu-blocklist"],
  ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
];

export async function startBrowser(): Promise<Browser> {
  const env = { ...process.env, LIBGL_ALWAYS_SOFTWARE: "1" } as Record<string, string>;
  if (firefoxPath) {
    const firefoxUserPrefs = { "webgl.force-enabled": true, "ui.prefersReducedMotion": 1 };
    return firefox.launch({ channel: "moz-firefox", executablePath: firefoxPath, headless: false, env, firefoxUserPrefs });
  }
  for (const renderer of kRenderers) {
    const args = ["--no-sandbox", "--use-gl=angle", ...renderer];
    const browser = await chromium.launch({ executablePath: chromiumPath() ?? "chromium", env, args });
    const page = await browser.newPage();
    const canDraw = await page.evaluate(() => document.createElement("canvas").getContext("webgl2") !== null);
    await page.close();
    if (canDraw) return browser;
    await browser.close();
  }
  throw new Error("Chromium draws no WebGL 2");
}

const isBelow = (url: string, address: string): boolean =>
  url === address || (address.endsWith("/") && url.startsWith(address));

/** Opens a file; requests to anywhere else and errors are noted. */
export const openFile = (browser: Browser, file: string, options: Window = {}): Promise<Opened> =>
  openPage(browser, pathToFileURL(file).href, options);

interface Window {
  width?: number;
  height?: number;
  hash?: string;
  touch?: boolean;
}
interface Opened {
  page: Page;
  requests: string[];
  errors: string[];
}

/** Opens an address; requests to other places than below it, and errors, are noted. */
export async function openPage(
  browser: Browser,
  address: string,
  options: Window = {},
): Promise<Opened> {
  const context = await browser.newContext({
    viewport: { width: options.width ?? 1000, height: options.height ?? 800 },
    hasTouch: options.touch ?? false,
    reducedMotion: "reduce",
  });
  const page = await context.newPage();
  page.setDefaultTimeout(120_000); // of a busy machine with software rendering
  const requests: string[] = [];
  const errors: string[] = [];
  page.on("request", (request) => {
    const url = request.url();
    if (!isBelow(url.split("#")[0] ?? "", address) && !/^(data|blob):/.test(url)) requests.push(url);
  });
  page.on("pageerror", (error) => errors.push(error.message));
  page.on("console", (message) => {
    if (message.type() === "error") errors.push(message.text());
  });
  await page.goto(address + (options.hash ? `#${options.hash}` : ""));
  await page.waitForSelector("body[data-state]", { timeout: 120_000 });
  return { page, requests, errors };
}

/** What axe finds that keeps people out. */
export async function violations(page: Page): Promise<[string, string[]][]> {
  await page.evaluate(readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8"));
  const found = (await page.evaluate(() => (window as any).axe.run())) as { violations: { id: string; nodes: { html: string }[] }[] };
  return found.violations.map((v) => [v.id, v.nodes.map((n) => n.html.slice(0, 120))]);
}

/** Waits until all is loaded and drawn. */
export const idle = (page: Page): Promise<unknown> =>
  page.waitForFunction(() => (window as any).pmspPage.viewer.isIdle, null, { timeout: 120_000 });

export interface Difference {
  mean: number;
  far: number;
  size: string;
}

/**
 * Of means over blocks of 8 x 8 pixels, as shares of full brightness: the mean difference, and the share of blocks that
 * are off by more than a tenth.
 */
export const difference = (page: Page, a: Buffer, b: Buffer): Promise<Difference> =>
  page.evaluate(
    async ([a, b]) => {
      const blocks = async (base64: string): Promise<[number[], string]> => {
        const image = new Image();
        image.src = `data:${base64.startsWith("/9j/") ? "image/jpeg" : "image/png"};base64,${base64}`;
        await image.decode();
        const canvas = document.createElement("canvas");
        [canvas.width, canvas.height] = [image.width, image.height];
        const context = canvas.getContext("2d")!;
        context.drawImage(image, 0, 0);
        const { data } = context.getImageData(0, 0, image.width, image.height);
        const means: number[] = [];
        for (let y = 0; y + 8 <= image.height; y += 8) {
          for (let x = 0; x + 8 <= image.width; x += 8) {
            for (let c = 0; c < 3; ++c) {
              let sum = 0;
              for (let i = 0; i < 64; ++i) sum += data[4 * ((y + (i >> 3)) * image.width + x + (i & 7)) + c]!;
              means.push(sum / 64 / 255);
            }
          }
        }
        return [means, `${image.width} x ${image.height}`];
      };
      const [[one, sizeOne], [other, sizeOther]] = [await blocks(a!), await blocks(b!)];
      const off = one.map((value, i) => Math.abs(value - (other[i] ?? 1)));
      const mean = off.reduce((sum, x) => sum + x, 0) / off.length;
      return { mean, far: off.filter((x) => x > 0.1).length / off.length, size: sizeOne === sizeOther ? "" : `${sizeOne}, not ${sizeOther}` };
    },
    [a.toString("base64"), b.toString("base64")],
  );
