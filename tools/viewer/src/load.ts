// SPDX-License-Identifier: BSD-2-Clause
// The points that the page itself holds.
import type { Cloud } from "./cloud";
import { type NodeData, blockText, bytesFromBase64, nodePoints } from "./data";
import { type Vec3, normalFrom } from "./geometry";

const kPatience = 40; // [ms] between two pictures

/**
 * Reads the cloud cube by cube, coarse ones first; `show` is called in between, with the number of cubes that are
 * there. Returns this number.
 */
export async function loadHeld(nodes: readonly NodeData[], cloud: Cloud, show: (cubes: number) => void): Promise<number> {
  let began = performance.now();
  let loaded = 0;
  for (const [i, node] of nodes.entries()) {
    const block = document.getElementById(`pmsp-node-${i}`);
    if (!block) continue;
    cloud.fill(i, nodePoints(bytesFromBase64(blockText(document, `node-${i}`)), node.points));
    block.remove();
    if (loaded++ > 0 && performance.now() - began < kPatience) continue;
    show(loaded);
    await new Promise((resolve) => setTimeout(resolve));
    began = performance.now();
  }
  return loaded;
}

/** Normals of the points of the root, an even sample of the cloud; of at most some thousands. */
export function rootNormals(nodes: readonly NodeData[]): Vec3[] {
  const text = blockText(document, "node-0");
  if (!nodes[0] || text === "") return [];
  const { count, normalsAndViews } = nodePoints(bytesFromBase64(text), nodes[0].points);
  const signed = (i: number): number => ((normalsAndViews[i] ?? 0) << 24) >> 24;
  const stride = Math.max(1, Math.floor(count / 20_000));
  const normals: Vec3[] = [];
  for (let i = 0; i < count; i += stride) normals.push(normalFrom(signed(4 * i), signed(4 * i + 1)));
  return normals;
}
