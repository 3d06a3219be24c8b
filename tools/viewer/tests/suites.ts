// SPDX-License-Identifier: BSD-2-Clause
// Runs all suites, or those named, in a browser one after the other, one that fails once more. They share what room.ts
// makes.
import { spawnSync } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

const folder = mkdtempSync(join(tmpdir(), "pmsp-suites-"));
const env = { ...process.env, PMSP_SUITES_FOLDER: folder };
const run = (suite: string): number => {
  const began = Date.now();
  const { status } = spawnSync(process.execPath, [join("build", "browser", `${suite}.e2e.mjs`)], { env, stdio: "inherit" });
  console.log(`# ${suite}: ${((Date.now() - began) / 1000).toFixed(0)} s, exit code ${status}`);
  return status ?? 1;
};
const named = process.argv.slice(2);
let status = 0;
for (const suite of named.length > 0 ? named : ["page", "measure", "stream", "live", "screens", "views"]) {
  status = run(suite);
  if (status !== 0 && status !== 77) status = run(suite); // 77: skipped
  if (status !== 0) break;
}
rmSync(folder, { recursive: true });
process.exit(status);
