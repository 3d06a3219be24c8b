// SPDX-License-Identifier: BSD-2-Clause
// The keyframes' depth maps, read when they are first needed: from the page, or fetched from beside it.
import { type KeyframeData, blockText, bytesFromBase64 } from "./data";
import { Depths } from "./depths";

/** Kept ones, of 4 MB each. */
const kMost = 12;

export class KeyframeDepths {
  /** By keyframe, the last used one last; null = it cannot be had. */
  private readonly held = new Map<number, Depths | null>();
  private readonly coming = new Map<number, Promise<Depths | null>>();

  constructor(private readonly keyframes: () => readonly KeyframeData[]) {}

  /** null = none; a promise while it is fetched. */
  of(which: number): Depths | null | Promise<Depths | null> {
    const { depths: name, photo_depths: address } = this.keyframes()[which] ?? {};
    const held = this.held.get(which);
    if (held !== undefined) return this.keep(which, held);
    if (name !== undefined) return this.keep(which, new Depths(bytesFromBase64(blockText(document, name))));
    if (address === undefined) return null;
    const coming = this.coming.get(which) ?? this.fetch(which, address);
    this.coming.set(which, coming);
    return coming;
  }

  private async fetch(which: number, address: string): Promise<Depths | null> {
    try {
      const reply = await fetch(address);
      if (!reply.ok) throw new Error(`no answer: ${reply.status}`);
      return this.keep(which, new Depths(new Uint8Array(await reply.arrayBuffer())));
    } catch (error) {
      console.warn(`depth map ${address}:`, error);
      return this.keep(which, null);
    } finally {
      this.coming.delete(which);
    }
  }

  private keep(which: number, depths: Depths | null): Depths | null {
    this.held.delete(which);
    this.held.set(which, depths);
    const [oldest = which] = this.held.keys();
    if (this.held.size > kMost) this.held.delete(oldest);
    return depths;
  }
}
