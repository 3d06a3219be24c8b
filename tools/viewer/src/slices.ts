// SPDX-License-Identifier: BSD-2-Clause
// Storeys, a horizontal slice, a cut by a box, and the size of points.
import { noCut, sliceCut, storeyCut } from "./cuts";
import { button, el, slider } from "./dom";
import type { ViewState } from "./state";
import type { Storey } from "./storeys";
import type { Viewer } from "./viewer";

/** Thickness of a slice, as a share of the height of the camera above its floor. */
const kThickness = 0.2;
const names = ["Along, from", "Along, to", "Across, from", "Across, to", "Height, from", "Height, to"];

export class Slices {
  readonly box = el("div", { id: "clip" });
  private readonly storeys = el("select", { "aria-label": "Storey" });
  private readonly sliceButton = button("Slice", () => this.toggleSlice());
  private readonly height: HTMLInputElement;
  private readonly heightText = el("output", {});
  private readonly clips: HTMLInputElement[] = [];
  private known: Storey[] = [];

  /** `changed`: called when something else is shown. */
  constructor(
    private readonly viewer: Viewer,
    private readonly state: ViewState,
    private readonly changed: () => void,
  ) {
    this.storeys.addEventListener("change", () => this.showStorey(Number(this.storeys.value)));
    const height = slider("Slice height", 0, 1, 0.5, (value) => this.slice(value));
    this.height = height.querySelector("input") as HTMLInputElement;
    this.box.append(this.storeys, this.sliceButton, height, this.heightText);
    names.forEach((name, i) => {
      const label = slider(name, 0, 1, i % 2, (value) => {
        const input = this.clips[i]!;
        state.cut[i] = value === Number(i % 2 === 0 ? input.min : input.max) ? null : value;
        changed();
      });
      this.clips.push(label.querySelector("input") as HTMLInputElement);
      this.box.append(label);
    });
    const size = slider("Point size", 0.3, 4, state.size, (value) => {
      state.size = value;
      changed();
    });
    this.box.append(button("Show all", () => this.cut(noCut())), size);
  }

  private cut(cut: ViewState["cut"]): void {
    this.state.cut = cut;
    this.changed();
  }

  private get isSlice(): boolean {
    const { cut } = this.state;
    const [low, high] = [cut[4] ?? null, cut[5] ?? null];
    return low !== null && high !== null && high - low < 1.05 * this.thickness;
  }

  private get thickness(): number {
    const { storey, cloud } = this.viewer;
    return kThickness * Math.max(storey.camera - storey.floor, 0.1 * (cloud.high[2] - cloud.low[2]));
  }

  private slice(height: number): void {
    this.cut(sliceCut(height, this.thickness));
  }

  private toggleSlice(): void {
    if (this.isSlice) this.cut(noCut());
    else this.slice(this.viewer.storey.camera);
  }

  /** -1 = all. */
  private showStorey(which: number): void {
    const storey = this.viewer.trajectory.storeys[which];
    this.cut(storey ? storeyCut(storey, which === 0) : noCut());
    if (storey) this.state.keyframe = this.viewer.trajectory.keyframeOn(storey, this.state.keyframe);
  }

  refresh(): void {
    const { cloud, scale } = this.viewer;
    const { storeys } = this.viewer.trajectory;
    const { cut } = this.state;
    if (this.known !== storeys) {
      this.known = storeys;
      const options = storeys.map((_, i) => el("option", { value: String(i) }, `Storey ${i + 1}`));
      this.storeys.replaceChildren(el("option", { value: "-1" }, "All storeys"), ...options);
    }
    this.storeys.hidden = storeys.length < 2;
    const shown = storeys.findIndex((it, i) => storeyCut(it, i === 0).every((x, k) => x === (cut[k] ?? null)));
    this.storeys.value = String(storeys.length < 2 ? -1 : shown);
    this.sliceButton.setAttribute("aria-pressed", String(this.isSlice));
    const place = (input: HTMLInputElement, axis: 0 | 1 | 2, value: number): void => {
      input.min = String(cloud.low[axis]);
      input.max = String(cloud.high[axis]);
      input.value = String(value);
    };
    this.clips.forEach((input, i) => {
      const axis = Math.floor(i / 2) as 0 | 1 | 2;
      place(input, axis, cut[i] ?? (i % 2 === 0 ? cloud.low : cloud.high)[axis]);
    });
    const middle = this.isSlice ? ((cut[4] ?? 0) + (cut[5] ?? 0)) / 2 : this.viewer.storey.camera;
    place(this.height, 2, middle);
    const floor = storeys.filter((it) => it.floor < middle).at(-1)?.floor ?? cloud.low[2];
    const text = `${(scale.factor * (middle - floor)).toPrecision(3)} ${scale.unit} above the floor`;
    this.height.setAttribute("aria-valuetext", text);
    this.heightText.textContent = text;
  }
}
