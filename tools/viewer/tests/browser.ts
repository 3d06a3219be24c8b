// SPDX-License-Identifier: BSD-2-Clause
// Opens pages in the system's chromium.
import { existsSync } from "node:fs";
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

/** Opens a file; requests to anywhere else and errors are noted. */
export async function openFile(
  browser: Browser,
  file: string,
  options: { width?: number; height?: number; hash?: string; touch?: boolean } = {},
): Promise<{ page: Page; requests: string[]; errors: string[] }> {
  const context = await browser.newContext({
    viewport: { width: options.width ?? 1000, height: options.height ?? 800 },
    hasTouch: options.touch ?? false,
  });
  const page = await context.newPage();
  const requests: string[] = [];
  const errors: string[] = [];
  const address = pathToFileURL(file).href;
  page.on("request", (request) => {
    const url = request.url();
    if (url.split("#")[0] !== address && !/^(data|blob):/.test(url)) requests.push(url);
  });
  page.on("pageerror", (error) => errors.push(error.message));
  page.on("console", (message) => {
    if (message.type() === "error") errors.push(message.text());
  });
  await page.goto(address + (options.hash ? `#${options.hash}` : ""));
  await page.waitForSelector("body[data-state]", { timeout: 120_000 });
  return { page, requests, errors };
}
