// SPDX-License-Identifier: BSD-2-Clause
// Loupe: what lies around the pointer, or the middle of the picture, enlarged while one measures.
import { WebGLRenderTarget } from "three";
import { el } from "./dom";
import { Throttle } from "./throttle";
import type { Viewer } from "./viewer";

const kSize = 168; // [px]
const kZoom = 4;
const kPause = 50; // [ms]

export class Loupe {
  private readonly canvas = el("canvas", { id: "loupe", width: String(kSize), height: String(kSize), "aria-hidden": "true" });
  private readonly target = new WebGLRenderTarget(kSize, kSize);
  private readonly bytes = new Uint8Array(4 * kSize * kSize);
  /** null = the middle of the picture. */
  private pointer: [number, number] | null = null;
  private readonly later = new Throttle(kPause, () => this.draw());

  /** `isWanted`: whether a click would take a point. */
  constructor(
    place: HTMLElement,
    private readonly viewer: Viewer,
    private readonly isWanted: () => boolean,
  ) {
    this.canvas.hidden = true;
    place.append(this.canvas);
    const { canvas } = viewer;
    canvas.addEventListener("pointermove", (event) => {
      const box = canvas.getBoundingClientRect();
      this.pointer = [event.clientX - box.left, event.clientY - box.top];
      if (isWanted()) this.later.request();
    });
    canvas.addEventListener("pointerleave", () => (this.pointer = null));
  }

  /** The picture, or what a click does, has changed. */
  changed(): void {
    if (this.isWanted()) this.later.request();
    else this.canvas.hidden = true;
  }

  private draw(): void {
    this.canvas.hidden = !this.isWanted();
    if (this.canvas.hidden) return;
    const { viewer, bytes } = this;
    const { clientWidth: width, clientHeight: height } = viewer.canvas;
    const [x, y] = this.pointer ?? [width / 2, height / 2];
    this.canvas.classList.toggle("left", x > width / 2 && y < height / 2);
    const side = kSize / kZoom;
    viewer.drawPart(this.target, x - side / 2, y - side / 2, side, kZoom);
    viewer.renderer.readRenderTargetPixels(this.target, 0, 0, kSize, kSize, bytes);
    const context = this.canvas.getContext("2d");
    if (!context) return;
    const image = context.createImageData(kSize, kSize);
    for (let row = 0; row < kSize; ++row) image.data.set(bytes.subarray(4 * kSize * (kSize - 1 - row), 4 * kSize * (kSize - row)), 4 * kSize * row);
    context.putImageData(image, 0, 0);
    for (const [color, wide] of [["#000", 3], ["#ffd23f", 1]] as const) {
      context.strokeStyle = color;
      context.lineWidth = wide;
      context.beginPath();
      for (const [from, to] of [[0.35, 0.47], [0.53, 0.65]] as const) {
        context.moveTo(from * kSize, kSize / 2);
        context.lineTo(to * kSize, kSize / 2);
        context.moveTo(kSize / 2, from * kSize);
        context.lineTo(kSize / 2, to * kSize);
      }
      context.stroke();
    }
  }
}
