// SPDX-License-Identifier: BSD-2-Clause
// The report below the picture: what was run, what came of it, and what is wrong.
import { type KeyframeData, type ReportData, bytesFromBase64, imageAddress } from "./data";
import { countText, el, percentText, svg } from "./dom";
import { type Vec3, dot } from "./geometry";
import { colorAt, cssColor, cssGradient } from "./palette";

function section(title: string, ...children: (Node | string | null | false)[]): HTMLElement {
  const name = title.toLowerCase().replace(/\W+/g, "-");
  return el("section", { "aria-labelledby": name }, el("h2", { id: name }, title), ...children);
}

function table(head: string[], rows: (string | Node)[][]): HTMLElement {
  const box = el("div", { class: "table", tabindex: "0", role: "region", "aria-label": `Table: ${head.join(", ")}` });
  const top = el("tr");
  for (const word of head) top.append(el("th", { scope: "col" }, word));
  const body = el("tbody");
  for (const row of rows) {
    const line = el("tr");
    for (const cell of row) line.append(el("td", {}, cell));
    body.append(line);
  }
  box.append(el("table", {}, el("thead", {}, top), body));
  return box;
}

function bars(label: string, entries: [string, number, string][], color: (share: number) => string): HTMLElement {
  const most = Math.max(...entries.map((e) => e[1]), 1e-12);
  const list = el("dl", { class: "bars", "aria-label": label });
  entries.forEach(([name, value, text], i) => {
    const bar = el("span", { class: "bar", "aria-hidden": "true" });
    bar.style.width = `${(100 * value) / most}%`;
    bar.style.background = color(entries.length > 1 ? i / (entries.length - 1) : 0.5);
    list.append(el("dt", {}, name), el("dd", {}, bar, el("span", { class: "value" }, text)));
  });
  return list;
}

function histogram(values: number[]): number[] {
  const counts = new Array<number>(10).fill(0);
  for (const v of values) {
    const bin = Math.max(0, Math.min(9, Math.floor(10 * v)));
    counts[bin] = (counts[bin] ?? 0) + 1;
  }
  return counts;
}

const tenths = (i: number): string => `${10 * i} to ${10 * i + 10} %`;

function coverage(map: NonNullable<ReportData["coverage_map"]>): HTMLElement {
  const shares = bytesFromBase64(map.shares);
  const canvas = el("canvas", {
    width: String(map.width),
    height: String(map.height),
    class: "coverage",
    role: "img",
    "aria-label": "Panorama of the share of depth maps with a depth in each direction",
  });
  const context = canvas.getContext("2d");
  if (context && shares.length === map.width * map.height) {
    const image = context.createImageData(map.width, map.height);
    shares.forEach((share, i) => image.data.set([...colorAt("cividis", share / 255), 255], 4 * i));
    context.putImageData(image, 0, 0);
  }
  const bar = el("span", { class: "gradient", "aria-hidden": "true" });
  bar.style.background = cssGradient("cividis");
  return el(
    "figure",
    {},
    canvas,
    el(
      "figcaption",
      {},
      `In how many of ${map.depth_maps} depth maps a direction of the camera has a depth: 0 % `,
      bar,
      " 100 %. The middle is straight ahead, the top straight up. Dark everywhere below is the rig or a mask.",
    ),
  );
}

function trajectory(data: ReportData, basis: readonly [Vec3, Vec3, Vec3], enter: (i: number) => void): HTMLElement {
  const flat = data.keyframes.map((k) => [dot(k.center, basis[0]), -dot(k.center, basis[1])] as const);
  const low = [Math.min(...flat.map((p) => p[0])), Math.min(...flat.map((p) => p[1]))] as const;
  const size = Math.max(...flat.map((p) => Math.max(p[0] - low[0], p[1] - low[1])), 1e-9);
  const at = (i: number): [number, number] => {
    const p = flat[i] ?? [0, 0];
    return [10 + (580 * (p[0] - low[0])) / size, 10 + (580 * (p[1] - low[1])) / size];
  };
  const high = Math.max(...flat.map((_, i) => at(i)[1])) + 10;
  const line = flat.map((_, i) => at(i).map((x) => x.toFixed(1)).join(",")).join(" ");
  const drawing = svg(
    "svg",
    { viewBox: `0 0 600 ${high.toFixed(0)}`, class: "path", role: "img", "aria-label": "The camera's path from above" },
    svg("polyline", { points: line, fill: "none", stroke: "#5b6770", "stroke-width": 2 }),
  );
  data.keyframes.forEach((keyframe, i) => {
    const used = keyframe.use === "depth map";
    const [x, y] = at(i);
    const mark = used
      ? svg("circle", { cx: x, cy: y, r: 4, fill: cssColor("viridis", i / Math.max(flat.length - 1, 1)) })
      : svg("path", { d: `M${x - 4} ${y - 4}l8 8m0 -8l-8 8`, stroke: "#b3261e", "stroke-width": 2 });
    mark.append(svg("title", {}, `keyframe ${keyframe.id}: ${keyframe.use}`));
    mark.addEventListener("click", () => enter(i));
    drawing.append(mark);
  });
  return el(
    "figure",
    {},
    drawing as unknown as Node,
    el("figcaption", {}, "From above, dark at the start, light at the end. Crosses are keyframes that are left out."),
  );
}

function strips(data: ReportData, enter: (i: number) => void): HTMLElement | null {
  const list = el("ol", { class: "strips" });
  data.keyframes.forEach((keyframe, i) => {
    const { strip } = keyframe;
    if (!strip) return;
    const item = el("li", {});
    const picture = (name: string | undefined, what: string): HTMLElement | null => {
      if (!name) return null;
      const alt = `${what} of keyframe ${keyframe.id}`;
      return el("img", { src: imageAddress(document, name), alt, decoding: "async", width: "320", height: "160" });
    };
    const button = el("button", { type: "button", class: "plain" }, `Keyframe ${keyframe.id}`);
    button.addEventListener("click", () => enter(i));
    const depths = strip.near && strip.far ? `, depths ${short(strip.near)} to ${short(strip.far)} ${data.unit}` : "";
    item.append(
      el("h3", {}, button),
      el("p", {}, `${percentText(keyframe.coverage ?? 0)} of the pixels have a depth, mean confidence ${(keyframe.confidence ?? 0).toFixed(2)}${depths}`),
      el("div", {}, picture(strip.image, "Image"), picture(strip.depth, "Depth"), picture(strip.confidence, "Confidence")),
    );
    list.append(item);
  });
  return list.childElementCount > 0 ? list : null;
}

const short = (x: number): string => String(Number(x.toPrecision(3)));

function leftOut(keyframes: KeyframeData[]): HTMLElement {
  const out = keyframes.filter((k) => k.use !== "depth map");
  const rows = out.map((k) => [String(k.id), k.use, k.reason ?? ""]);
  return out.length > 0
    ? table(["Keyframe", "Why it has no depth map", "In detail"], rows)
    : el("p", {}, "All keyframes have a depth map.");
}

/** Fills the report. `enter`: a keyframe was clicked. */
export function writeReport(
  data: ReportData,
  place: HTMLElement,
  basis: readonly [Vec3, Vec3, Vec3],
  enter: (which: number) => void,
): void {
  const problems = el("ul", { class: "problems" });
  for (const text of data.problems) problems.append(el("li", {}, text));
  const facts = el("dl", { class: "facts" });
  for (const [name, value] of data.facts) facts.append(el("dt", {}, name), el("dd", {}, value));
  const all = data.times.reduce((sum, it) => sum + it[1], 0);
  const times = data.times
    .filter((it) => it[1] > 0.005 * all)
    .map(([name, s]): [string, number, string] => [name, s, `${s.toFixed(1)} s, ${percentText(s / all)}`]);
  const points = data.confidences.reduce((sum, n) => sum + n, 0);
  const covered = data.keyframes.filter((k) => k.coverage !== undefined).map((k) => k.coverage ?? 0);
  const strip = strips(data, enter);
  const used = data.keyframes.filter((k) => k.use === "depth map").length;
  for (const part of [
    data.live_page_version === undefined && section(
      "What to know first",
      data.problems.length > 0 ? problems : el("p", {}, "Nothing unusual was noticed."),
    ),
    data.facts.length > 0 && section("What was run", facts),
    data.keyframes.length > 0 &&
      section("Keyframes", el("p", {}, `${used} of ${data.keyframes.length} keyframes have a depth map.`), leftOut(data.keyframes)),
    data.keyframes.length > 1 && section("Path of the camera", trajectory(data, basis, enter)),
    times.length > 0 && section("Where the time went", bars("Seconds", times, () => cssColor("cividis", 0.3))),
    points > 0 &&
      section(
        "Confidence of the points",
        el("p", {}, "Confidence 0.5 stands for an expected error of 0.5 % of the depth, 0.1 for 4.5 %, 0.8 for 0.13 %."),
        bars(
          "Points by confidence",
          data.confidences.map((n, i) => [`${i / 10} to ${(i + 1) / 10}`, n, `${countText(n)}, ${percentText(n / points)}`]),
          (share) => cssColor("cividis", share),
        ),
      ),
    covered.length > 0 &&
      section(
        "Coverage",
        el("p", {}, "How many keyframes have a depth in so many of their pixels, without masked ones."),
        bars(
          "Keyframes by coverage",
          histogram(covered).map((n, i) => [tenths(i), n, String(n)]),
          (share) => cssColor("cividis", share),
        ),
        data.coverage_map ? coverage(data.coverage_map) : null,
      ),
    strip && section("Keyframe by keyframe", strip),
    data.notes.length > 0 && section("About this page", el("ul", {}, ...data.notes.map((text) => el("li", {}, text)))),
  ]) {
    if (part) place.append(part);
  }
}
