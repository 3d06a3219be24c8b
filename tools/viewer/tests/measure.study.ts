// SPDX-License-Identifier: BSD-2-Clause
// How far off measurements are, and what is told: clicks on walls, edges and corners of synthetic missions, from the
// keyframes' places, on points and in photos, and what is measured between them. No test.
//
//   PMSP_DENSIFY=build/pmsp-densify PMSP_SYNTH=build/pmsp-synth npm run measure-study -- FOLDER [NAME [SEED,...]]
//
// Only missions with NAME in their name, or that in a folder NAME: map.msg, images/, gt/ as pmsp-synth writes them.
// They are kept in FOLDER, so that another run only clicks. SEED: of scenes and of depth maps.
import { execFileSync } from "node:child_process";
import { cpSync, existsSync, mkdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { PerspectiveCamera, Vector3 } from "three";
import { noCut } from "../src/cuts";
import { Cloud } from "../src/cloud";
import { type ReportData, bytesFromBase64, nodePoints } from "../src/data";
import { Depths } from "../src/depths";
import { type Pose, type Vec3, add, basisAround, cross, dot, fromCamera, mainDirection, norm, panoramaPlace, sub, times, toCamera, unit } from "../src/geometry";
import { type Kind, type Picked, covarianceOf, pointsOf, resultOf, spreadOnPlanes, unscaled, valueOf } from "../src/measure";
import { type Photo, pickedInPhoto, placesInPhoto } from "../src/photo_pick";
import { pick } from "../src/pick";
import { type PotreeNode, potreeFrom, potreePoints } from "../src/potree";
import { kSnapPixels, snapped } from "../src/snap";
import { type Eyes, pickedFrom, pixelAt } from "../src/surroundings";
import { type RangeMap, readRangeMap } from "./range_map";

const [folder, only = "", seeds = "1,2"] = process.argv.slice(2);
const { PMSP_DENSIFY: densify, PMSP_SYNTH: synth } = process.env;
if (!folder || !densify || !synth) throw new Error("usage: measure-study FOLDER [NAME [SEED,...]], with PMSP_DENSIFY and PMSP_SYNTH");

/** Points of the page; the rest comes from the Potree folder. */
const kAll = 1_000_000;
const kFew = 3000;
const missions: [name: string, held: number, words: string][] = [
  ["room 512", kAll, "--scene room --width 512"],
  ["room 1024", kAll, "--scene room --width 1024"],
  ["room 512, streamed", kFew, "--scene room --width 512 --keyframes 6"],
  ["room 1024, cheap camera, scale 0.4", kAll, "--scene room --width 1024 --camera cheap --map-scale 0.4"],
  ["corridor 512", kAll, "--scene corridor --width 512"],
  ["corridor 1024", kAll, "--scene corridor --width 1024"],
  ["painted 512", kAll, "--scene painted --width 512"],
  ["painted 1024", kAll, "--scene painted --width 1024"],
  ["thin 1024, streamed, scale 3", kFew, "--scene thin --width 1024 --map-scale 3"],
  ["sample mission", kAll, "data"],
];
if (existsSync(join(only, "map.msg"))) missions.splice(0, missions.length, [only, kAll, only]);
/** A flight through a warehouse, beside the rooms. */
const kSample = "data";
const kClicks = 40; // of each keyframe, besides corners
const kMeasured = 400; // of each kind and mission
const [kWidth, kHeight] = [1000, 800];

let state = 1;
const random = (): number => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32;

type Place = "wall" | "edge" | "inner corner" | "outer corner";
const ways = ["points", "photo", "snapped"] as const;
type Way = (typeof ways)[number];
interface Click {
  way: Way;
  place: Place;
  /** From the page's origin. */
  truth: Vec3;
  picked: Picked;
}

/** Corners of the scenes as src/synth/ready_made.cpp builds them: [x, z, sizes, degrees] of what stands in a room. */
const stands: Record<string, number[][]> = {
  room: [[-2.5, -1, 0.8, 2, 1.6, 0], [2.2, 1.2, 1.2, 0.8, 1.8, 20], [-1.2, 2.6, 1, 1.1, 0.8, -35], [1.3, -3, 0.9, 1.7, 0.7, 10], [-0.9, 0.6, 0.5, 0.5, 0.5, 45]],
  painted: [[-2.5, -1, 0.8, 2, 1.6, 0], [2.2, 1.2, 1.2, 0.8, 1.8, 20], [1.3, -3, 0.9, 1.7, 0.7, 10], [-0.9, 0.6, 0.5, 0.5, 0.5, 45]],
};
const halves: Record<string, Vec3> = { room: [3, 1.5, 4], painted: [3, 1.5, 4], corridor: [1.1, 1.3, 9] };

function cornersOf(scene: string): [Place, Vec3][] {
  const found: [Place, Vec3][] = [];
  const half = halves[scene];
  for (let i = 0; half && i < 8; ++i) {
    found.push(["inner corner", [(i & 1 ? 1 : -1) * half[0], (i & 2 ? 1 : -1) * half[1], (i & 4 ? 1 : -1) * half[2]]]);
  }
  for (const [x = 0, z = 0, width = 0, height = 0, depth = 0, degrees = 0] of stands[scene] ?? []) {
    const [cos, sin] = [Math.cos((degrees * Math.PI) / 180), Math.sin((degrees * Math.PI) / 180)];
    for (let i = 0; i < 4; ++i) {
      const [right, ahead] = [((i & 1) - 0.5) * width, ((i >> 1) - 0.5) * depth];
      found.push(["outer corner", [x + cos * right + sin * ahead, 1.5 - height, z - sin * right + cos * ahead]]);
    }
  }
  return found;
}

function make(name: string, held: number, words: string, seed: number): string {
  const at = join(folder!, `${name.replaceAll(/[^a-z0-9]+/g, "_")}_${seed}`);
  if (existsSync(join(at, "r.html"))) return at;
  mkdirSync(at, { recursive: true });
  const mission = join(at, "m");
  if (words === kSample) cpSync(join(process.cwd(), "../../data"), mission, { recursive: true });
  else if (words === name) cpSync(name, mission, { recursive: true, dereference: true });
  else execFileSync(synth!, [...words.split(" "), "--seed", String(seed), "--force", "-o", mission], { stdio: "ignore" });
  execFileSync(
    densify!,
    ["run", join(mission, "map.msg"), "--images", join(mission, "images"), "-o", join(at, "c.potree"), "--report", join(at, "r.html")]
      .concat(["--report-points", String(held), "--report-panoramas", "1000", "--backend", "cpu", "--progress", "none", "--force"])
      .concat(["--align", join(mission, "gt", "traj_tum.txt"), "--seed", String(seed)]),
    { stdio: ["ignore", "ignore", "inherit"] },
  );
  return at;
}

/** The page's cloud; with what a served one streams. */
function load(at: string, streams: boolean): { data: ReportData; cloud: Cloud; photos: Photo[] } {
  const html = readFileSync(join(at, "r.html"), "utf8");
  const tag = '<script type="application/json" id="pmsp-data">';
  const begin = html.indexOf(tag) + tag.length;
  const data = JSON.parse(html.slice(begin, html.indexOf("</script>", begin))) as ReportData;
  const basis = basisAround(data.up, mainDirection(data.keyframes.map((k) => k.center), data.up));
  const cloud = new Cloud(data.nodes, basis);
  for (const found of html.matchAll(/id="pmsp-node-(\d+)">([^<]*)</g)) {
    const which = Number(found[1]);
    cloud.fill(which, nodePoints(bytesFromBase64(found[2] ?? ""), data.nodes[which]?.points ?? 0));
  }
  if (streams) {
    const bytes = (name: string): Uint8Array<ArrayBuffer> => new Uint8Array(readFileSync(join(at, "c.potree", name)));
    const tree = potreeFrom(readFileSync(join(at, "c.potree", "metadata.json"), "utf8"), bytes("hierarchy.bin"), data.origin);
    const all = bytes("octree.bin");
    const visit = (node: PotreeNode): void => {
      let cube = cloud.cubes.find((it) => it.level === node.level && norm(sub(it.corner, node.corner)) < 1e-3 * node.side);
      if (!cube) cloud.cubes.push((cube = cloud.octreeCube(node.level, node.corner, node.side)));
      cloud.exchange(cube, potreePoints(tree, node, all.slice(node.first, node.first + node.bytes)));
      node.children.forEach(visit);
    };
    visit(tree.root);
  }
  cloud.measureExtent(data.keyframes.map((k) => sub(k.center, data.origin)));
  cloud.setLook("photo", 1, noCut(), false);
  const blocks = new Map([...html.matchAll(/id="pmsp-(depths-[^"]*)">([^<]*)</g)].map((found) => [found[1], found[2]]));
  const photos = data.keyframes.flatMap((keyframe, i): Photo[] => {
    if (!keyframe.depths) return [];
    const depths = new Depths(bytesFromBase64(blocks.get(keyframe.depths) ?? ""));
    const pose = { center: sub(keyframe.center, data.origin), rotation: keyframe.rotation };
    return [{ depths, pose, keyframe: i, lensDistance: data.lens_distance ?? 0 }];
  });
  return { data, cloud, photos };
}

/** Places to click at from a keyframe, in the frame of the file. */
function placesFrom(pose: Pose, ranges: RangeMap, corners: readonly [Place, Vec3][]): [Place, Vec3][] {
  const at = (column: number, row: number): Vec3 | null => {
    const range = ranges.at(column, row);
    const longitude = ((column + 0.5) / ranges.width - 0.5) * 2 * Math.PI;
    const latitude = (0.5 - (row + 0.5) / ranges.height) * Math.PI;
    const ray: Vec3 = [Math.cos(latitude) * Math.sin(longitude), -Math.sin(latitude), Math.cos(latitude) * Math.cos(longitude)];
    return range > 0 ? add(pose.center, times(fromCamera(pose, ray), range)) : null;
  };
  const found: [Place, Vec3][] = [];
  const step = Math.round(ranges.width / 300); // 1.2 degrees
  for (let i = 0; i < kClicks; ++i) {
    const column = Math.floor(random() * ranges.width);
    const row = Math.floor((0.5 - (0.9 * Math.asin(2 * random() - 1)) / Math.PI) * ranges.height);
    const here = at(column, row);
    const around = [at(column - step, row), at(column + step, row), at(column, row - step), at(column, row + step)];
    if (!here || around.some((it) => !it)) continue;
    const [left, right, above, below] = around as [Vec3, Vec3, Vec3, Vec3];
    const normal = unit(cross(sub(right, left), sub(below, above)));
    const bent = Math.max(...[left, right, above, below].map((it) => Math.abs(dot(sub(it, here), normal))));
    found.push([bent < 0.002 * ranges.at(column, row) ? "wall" : "edge", here]);
  }
  for (const [place, corner] of corners) {
    const ray = sub(corner, pose.center);
    const [across, down] = panoramaPlace(toCamera(pose, ray));
    let off = Number.POSITIVE_INFINITY; // what stands before it hides it
    for (let i = 0; i < 9; ++i) {
      const range = ranges.at(Math.floor(across * ranges.width) + (i % 3) - 1, Math.floor(down * ranges.height) + Math.floor(i / 3) - 1);
      off = Math.min(off, Math.abs(range - norm(ray)));
    }
    if (off < 0.03 * norm(ray)) found.push([place, corner]);
  }
  return found;
}

/** Clicks in photos without an answer, and all, by mission and by kind of place. */
const refusals = new Map<string, [refused: number, all: number]>();
function count(name: string, isRefused: boolean): void {
  const [refused, all] = refusals.get(name) ?? [0, 0];
  refusals.set(name, [refused + (isRefused ? 1 : 0), all + 1]);
}

interface Session {
  eyes: Eyes;
  up: Vec3;
  size: number;
  clicks: Click[];
}

function click(at: string, name: string, scene: string, streams: boolean): Session {
  const { data, cloud, photos } = load(at, streams);
  const size = norm(sub(cloud.high, cloud.low));
  const camera = (i: number): Vec3 | null => (data.keyframes[i] ? sub(data.keyframes[i].center, data.origin) : null);
  const eyes: Eyes = { pixel: data.pixel, reach: size / 2, camera };
  const clicks: Click[] = [];
  const snaps: Record<string, number> = {};
  const map = (frame: number): string => join(at, "m", "gt", "range_mm", `${String(frame).padStart(6, "0")}.png`);
  const lines = readFileSync(join(at, "m", "gt", "traj_tum.txt"), "utf8").split("\n").filter((line) => /^[\d.]/.test(line));
  const cameras = lines.map((line) => line.split(" ").slice(1, 4).map(Number) as unknown as Vec3);
  data.keyframes.forEach((keyframe, i) => {
    const photo = photos.find((it) => it.keyframe === i);
    if (keyframe.use !== "depth map") return;
    const away = cameras.map((it, frame) => (existsSync(map(frame)) ? norm(sub(it, keyframe.center)) : Number.POSITIVE_INFINITY));
    const ranges = readRangeMap(map(away.indexOf(Math.min(...away))));
    for (const [place, where] of placesFrom(keyframe, ranges, cornersOf(scene))) {
      const truth = sub(where, data.origin);
      const eye = sub(keyframe.center, data.origin);
      const view = new PerspectiveCamera(random() < 0.7 ? 60 : 25, kWidth / kHeight, 1e-4 * size, 100 * size);
      view.up.set(...cloud.basis[2]);
      view.position.set(...eye);
      view.lookAt(new Vector3(...truth));
      view.updateMatrixWorld();
      const inPhoto = photo && pickedInPhoto(photo, sub(truth, eye));
      for (const group of inPhoto ? [name, place] : []) count(group, typeof inPhoto === "string");
      if (photo && inPhoto && typeof inPhoto !== "string") {
        clicks.push({ way: "photo", place, truth, picked: inPhoto });
        const { position } = inPhoto;
        const to = snapped(placesInPhoto(photo, position, kSnapPixels), position, unit(sub(truth, eye)), pixelAt(inPhoto, eyes));
        clicks.push({ way: "snapped", place, truth, picked: to ? { ...inPhoto, position: to.position, spread: spreadOnPlanes(inPhoto, to.spread, to.kind === "plane") } : inPhoto });
        const snap = `${place}, to ${to?.kind ?? "nothing"}`;
        snaps[snap] = (snaps[snap] ?? 0) + 1;
      }
      const found = pick(cloud, view, kWidth / 2, kHeight / 2, kWidth, kHeight, 12);
      if (!found) continue;
      clicks.push({ way: "points", place, truth, picked: pickedFrom(cloud, view, found, 0, 0, eyes) });
    }
  });
  console.log("snapped:", snaps);
  return { eyes, up: cloud.basis[2], size, clicks };
}

interface Measured {
  value: number;
  truth: number;
  told: number;
}

function measure(session: Session, kind: Kind, way: Way): Measured[] {
  const { eyes, up, size } = session;
  const clicks = session.clicks.filter((it) => it.way === way);
  const found: Measured[] = [];
  for (let i = 0; i < 20 * kMeasured && found.length < kMeasured; ++i) {
    const chosen = Array.from({ length: kind === "area" ? 4 : pointsOf[kind] }, () => clicks[Math.floor(random() * clicks.length)]!);
    const places = chosen.map((it) => it.truth);
    // As far from each other as one measures.
    if (places.some((a, k) => places.some((b, l) => k !== l && norm(sub(a, b)) < 0.1 * size))) continue;
    const told = resultOf({ kind, points: chosen.map((it) => it.picked) }, { up, scale: unscaled("m"), reach: eyes.reach, camera: eyes.camera });
    found.push({ value: told.value, truth: valueOf(kind, places, up), told: told.error });
  }
  return found;
}

function quantile(values: readonly number[], share: number): number {
  const sorted = values.slice().sort((a, b) => a - b);
  return sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))] ?? Number.NaN;
}
const percent = (share: number): string => `${(100 * share).toFixed(1)} %`.padStart(7);

function tell(name: string, all: readonly Measured[]): void {
  if (all.length === 0) return;
  const within = all.filter((it) => Math.abs(it.value - it.truth) <= it.told).length / all.length;
  const relative = (of: (it: Measured) => number): string => percent(quantile(all.map((it) => of(it) / Math.max(it.truth, 1e-9)), 0.5));
  const off = (share: number): string => quantile(all.map((it) => Math.abs(it.value - it.truth) / it.told), share).toFixed(2);
  console.log(`${name.padEnd(46)} ${String(all.length).padStart(6)}  within ${percent(within)}  told ${relative((it) => it.told)}  off ${relative((it) => Math.abs(it.value - it.truth))}  off / told ${off(0.5)} ${off(0.95)}`);
}

const kinds: Kind[] = ["distance", "height", "angle", "area"];
const groups = new Map<string, Measured[]>();
const put = (name: string, more: readonly Measured[]): void => void groups.set(name, [...(groups.get(name) ?? []), ...more]);
for (const [name, held, words] of missions.filter((it) => it[0].includes(only))) {
  for (const seed of seeds.split(",").map(Number)) {
    process.stderr.write(`${name}, seed ${seed}\n`);
    const session = click(make(name, held, words, seed), name, words.split(" ")[1] ?? "", held === kFew);
    for (const way of ways) {
      for (const kind of kinds) {
        const found = measure(session, kind, way);
        put(`${name}, ${way}`, found);
        put(`all ${way}: ${kind}`, found);
      }
    }
    for (const { way, place, truth, picked } of session.clicks) {
      const off = sub(picked.position, truth);
      const along = unit(off);
      const c = covarianceOf(picked, session.eyes.camera(picked.keyframe), session.eyes.reach);
      const told = Math.sqrt(along.reduce((sum, x, i) => sum + x * dot([c[3 * i]!, c[3 * i + 1]!, c[3 * i + 2]!], along), 0));
      const depth = pixelAt(picked, session.eyes) / session.eyes.pixel;
      put(`${way}: ${place}`, [{ value: depth + norm(off), truth: depth, told }]); // shares of its distance
    }
  }
}
for (const [name, all] of groups) tell(name, all);
for (const [name, [refused, all]] of refusals) console.log(`refused in photos, ${name}: ${refused} of ${all}`);
