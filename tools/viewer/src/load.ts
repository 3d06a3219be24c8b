// SPDX-License-Identifier: BSD-2-Clause
// The points that the page itself holds.
import type { Cloud } from "./cloud";
import { type NodeData, blockText, bytesFromBase64, nodePoints } from "./data";

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
