// SPDX-License-Identifier: BSD-2-Clause
// Opens pages in the system's chromium.
import { existsSync, readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { pathToFileURL } from "node:url";
import { type Browser, type Page, chromium } from "playwright-core";

export const chromiumPath = (): string | undefined =>
  [process.env["PMSP_CHROMIUM"], "/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"].find(
    (path) => path && existsSync(path),
  );

export async function startBrowser(): Promise<Browser> {
  return chromium.launch({
    executablePath: chromiumPath() ?? "chromium",
    args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
  });
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
