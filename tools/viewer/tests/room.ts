// SPDX-License-Identifier: BSD-2-Clause
// A page of the synthetic room, made once for suites that run together (suites.ts).
import { execFileSync } from "node:child_process";
import { cpSync, existsSync, mkdirSync, mkdtempSync, renameSync } from "node:fs";
import { join } from "node:path";

/** Returns the page, in the folder of all suites, else in `own`. Its names would hurt a page that takes text for HTML. */
export function roomReport(own: string): string {
  const all = process.env["PMSP_SUITES_FOLDER"] ?? own;
  const report = join(all, "report.html");
  if (existsSync(report)) return report;
  const folder = mkdtempSync(join(all, "room-"));
  const mission = join(folder, "mission");
  execFileSync(process.env["PMSP_SYNTH"]!, ["--scene", "room", "--width", "1024", "--keyframes", "6", "-o", mission], { stdio: "ignore" });
  const evil = join(folder, "<", "script><img src=x onerror=window.hurt=1>");
  mkdirSync(evil, { recursive: true });
  const map = join(evil, "<b>&map.msg");
  cpSync(join(mission, "map.msg"), map);
  execFileSync(
    process.env["PMSP_DENSIFY"]!,
    ["run", map, "--images", join(mission, "images"), "-o", join(folder, "c.ply"), "--report", join(folder, "report.html")]
      .concat(["--quality", "online", "--backend", "cpu", "--width", "640", "--height", "320", "--progress", "none", "--report-panoramas", "3", "--scale", "1"]),
    { stdio: ["ignore", "ignore", "inherit"] },
  );
  renameSync(join(folder, "report.html"), report);
  return report;
}
