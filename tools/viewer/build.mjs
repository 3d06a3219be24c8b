// SPDX-License-Identifier: BSD-2-Clause
// Makes the page of one file: node build.mjs --write (prebuilt/report.html) | --check (is it
// that?) | --to FILE | --tests | --browser-test | --study (these into build/)
import { createHash } from "node:crypto";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = dirname(fileURLToPath(import.meta.url));
const prebuilt = join(here, "prebuilt", "report.html");
const read = (...path) => readFileSync(join(here, ...path), "utf8");

// A script ends at the first "</script", wherever it stands.
const safe = (script) => script.replaceAll("</script", "<\\/script").replaceAll("<!--", "<\\!--");

// Modules of three instead of its one file, so that unused ones stay out; and no text of its materials, since the page has
// materials of its own.
const slimThree = {
  name: "slim three",
  setup: (build) => {
    build.onResolve({ filter: /^three$/ }, () => ({ path: join(here, "node_modules", "three", "src", "Three.js") }));
    build.onLoad({ filter: /three.src.renderers.shaders.Shader(Chunk|Lib).*\.glsl\.js$/ }, () => ({
      contents: 'export default ""; export const vertex = "", fragment = "";',
    }));
  },
};

async function page() {
  const result = await build({
    entryPoints: [join(here, "src", "main.ts")],
    bundle: true,
    minify: true,
    write: false,
    format: "iife",
    target: ["es2022"],
    legalComments: "none",
    absWorkingDir: here,
    plugins: [slimThree],
  });
  const licence = (name) => read("node_modules", name, "LICENSE").trim().replaceAll("*/", "* /");
  const script = safe(`/*!\nThis page holds three.js.\n\n${licence("three")}\n\nIt holds fflate.\n\n${licence("fflate")}\n*/\n${result.outputFiles[0].text.trim()}\n`);
  const hash = createHash("sha256").update(script).digest("base64");
  const parts = { "%STYLE%": read("src", "page.css"), "%SCRIPT%": script, "%SCRIPT_HASH%": hash };
  return read("src", "page.html").replace(/%[A-Z_]+%/g, (name) => parts[name] ?? name);
}

const [what, file] = process.argv.slice(2);
if (what === "--write" || (what === "--to" && file)) {
  const target = what === "--to" ? file : prebuilt;
  mkdirSync(dirname(target), { recursive: true });
  writeFileSync(target, await page());
} else if (what === "--check") {
  if ((await page()) !== readFileSync(prebuilt, "utf8")) {
    console.error("tools/viewer/prebuilt/report.html is not what its sources give; run: npm run build");
    process.exit(1);
  }
  console.log("the prebuilt page is what its sources give");
} else if (what === "--tests") {
  await build({
    entryPoints: ["geometry", "measure", "state", "data", "palette", "live", "framing", "potree", "around", "surroundings", "depths", "exports", "lengths", "snap", "seen", "pace", "detail", "storeys"].map((name) => join(here, "tests", `${name}.test.ts`)),
    bundle: true,
    platform: "node",
    format: "esm",
    outdir: join(here, "build", "unit"),
    outExtension: { ".js": ".mjs" },
  });
} else if (what === "--browser-test") {
  await build({
    entryPoints: ["page.e2e", "measure.e2e", "live.e2e", "stream.e2e", "screens.e2e", "views.e2e", "suites"].map((name) => join(here, "tests", `${name}.ts`)),
    bundle: true,
    platform: "node",
    format: "esm",
    external: ["playwright-core", "axe-core"],
    outdir: join(here, "build", "browser"),
    outExtension: { ".js": ".mjs" },
  });
} else if (what === "--study") {
  await build({
    entryPoints: [join(here, "tests", "measure.study.ts")],
    bundle: true,
    platform: "node",
    format: "esm",
    outfile: join(here, "build", "study", "measure.study.mjs"),
  });
} else {
  console.error("usage: node build.mjs --write | --check | --to FILE | --tests | --browser-test | --study");
  process.exit(2);
}
