// SPDX-License-Identifier: BSD-2-Clause
// Measurements and notes below the picture: a table, its buttons, and the known length.
import { button, el, percentText } from "./dom";
import { type Row, type Sheet, csvOf, dxfOf, geojsonOf, textOf } from "./exports";
import { type Vec3, add, times } from "./geometry";
import { convertCommand, hasUnits, units } from "./lengths";
import { type Scale, type Valued, measureText } from "./measure";
import type { Measuring } from "./measuring";
import { type ViewState, kMaxLetters } from "./state";
import type { Viewer } from "./viewer";
import { kindWords } from "./words";

/** What is measured and noted, with coordinates in the frame of the cloud. */
function sheetOf(viewer: Viewer): Sheet {
  const { state, data, scale } = viewer;
  const short = (x: number): number => Number(x.toPrecision(12));
  const places = (all: readonly Vec3[]): Vec3[] => all.map((p) => times(add(p, data.origin), scale.factor).map(short) as unknown as Vec3);
  const measured = state.measurements.map((it): Row => {
    const { value, error, parts } = viewer.result(it);
    return { name: it.name ?? "", kind: it.kind, points: places(it.points.map((p) => p.position)), value, error, ...parts };
  });
  const notes = state.notes.map((it): Row => ({ name: it.text, kind: "note", points: places([it.position]) }));
  return { unit: scale.unit, scale: scale.factor, rows: [...measured, ...notes] };
}

export function download(name: string, type: string, text: string): void {
  const address = URL.createObjectURL(new Blob([text], { type }));
  el("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 1000);
}

/** Returns whether it worked: a page that was opened from disk may not use the clipboard's own interface. */
async function copied(text: string): Promise<boolean> {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    const area = el("textarea", { "aria-hidden": "true" });
    area.value = text;
    document.body.append(area);
    area.select();
    const works = document.execCommand("copy");
    area.remove();
    return works;
  }
}

export class Results {
  private readonly table = el("div", { class: "table", tabindex: "0", role: "region", "aria-label": "Table of measurements and notes" });
  private readonly known = el("div", {});
  private readonly select = el("select", { "aria-label": "Unit of lengths" });
  private readonly snap = el("input", { type: "checkbox" });
  private readonly undoButton: HTMLButtonElement;
  private shown = "";

  constructor(
    place: HTMLElement,
    private readonly viewer: Viewer,
    private readonly state: ViewState,
    private readonly measuring: Measuring,
    private readonly say: (text: string) => void,
    private readonly changed: () => void,
  ) {
    const sheet = (): Sheet => sheetOf(viewer);
    this.undoButton = button("Undo", () => measuring.undo());
    for (const unit of new Set([viewer.data.unit, ...units])) this.select.append(el("option", { value: unit }, unit));
    this.select.addEventListener("change", () => this.setUnit(this.select.value));
    this.snap.addEventListener("change", () => measuring.toggleSnapping());
    place.append(
      el(
        "div",
        { role: "group", "aria-label": "Measurements", class: "buttons" },
        this.undoButton,
        button("Clear", () => measuring.clear()),
        button("Copy", () => this.copy()),
        button("CSV", () => download("measurements.csv", "text/csv", csvOf(sheet()))),
        button("GeoJSON", () => download("measurements.geojson", "application/geo+json", geojsonOf(sheet()))),
        button("DXF", () => download("measurements.dxf", "image/vnd.dxf", dxfOf(sheet()))),
        button("Best photo", () => measuring.showBestPhoto()),
        el("label", {}, this.select),
        el("label", {}, this.snap, "Snap"),
      ),
      this.known,
      this.table,
    );
    this.refresh();
  }

  copy(): void {
    const { rows } = sheetOf(this.viewer);
    if (rows.length === 0) return this.say("There is nothing to copy.");
    void copied(textOf(sheetOf(this.viewer))).then((works) => this.say(works ? "Measurements and notes are copied." : "The browser refuses to copy."));
  }

  /** Between metres and feet. */
  nextUnit(): void {
    if (!hasUnits(this.viewer.data.unit, this.state.calibration)) return this.say("The scale is unknown: measure a known length first.");
    this.setUnit(this.viewer.scale.unit === "m" ? "ft" : "m");
  }

  private setUnit(unit: string): void {
    this.state.unit = units.find((it) => it === unit) ?? null;
    this.changed();
  }

  refresh(): void {
    const { viewer, state } = this;
    const { scale } = viewer;
    this.select.disabled = !hasUnits(viewer.data.unit, state.calibration);
    this.select.value = scale.unit;
    this.snap.checked = this.measuring.picking.snaps;
    const before = this.shown;
    this.setShown();
    if (this.shown === before) return;
    this.known.replaceChildren(...this.knownLength(scale));
    this.table.hidden = state.measurements.length + state.notes.length === 0;
    this.table.replaceChildren(this.rows(scale));
  }

  /** What the table shows now. */
  private setShown(): void {
    const { viewer, state } = this;
    this.shown = JSON.stringify([viewer.scale, state.measurements.map((it) => [it, viewer.result(it)]), state.notes, state.calibration]);
  }

  /** The table stays, and with it the focus. */
  private rename(which: number, name: string): void {
    this.measuring.change(() => {
      const it = this.state.measurements[which]!;
      if (name === "") delete it.name;
      else it.name = name;
      this.setShown();
    });
  }

  private remove(act: () => void): void {
    this.measuring.change(act);
    this.undoButton.focus();
  }

  private knownLength(scale: Scale): HTMLElement[] {
    const { state, viewer } = this;
    const known = state.calibration;
    if (!known) return [];
    const length = `${Number(known.metres.toPrecision(6))} m ± ${percentText(scale.relativeError)}`;
    const summary = el("p", {}, `Lengths follow from a known one of ${length}. `, button("Remove known length", () => this.remove(() => (state.calibration = null))));
    if (viewer.data.convert === undefined) return [summary];
    const command = convertCommand(viewer.data.convert, known, viewer.data.origin);
    return [
      summary,
      el("p", {}, "The cloud in metres: ", el("code", {}, command), " ", button("Copy command", () => {
        void copied(command).then((works) => this.say(works ? "The command is copied." : "The browser refuses to copy."));
      })),
    ];
  }

  private rows({ unit }: Scale): HTMLElement {
    const { state, viewer, measuring } = this;
    const body = el("tbody", {});
    const text = (it: Valued | undefined): string => (it ? measureText("distance", it.value, it.error, unit) : "");
    state.measurements.forEach((it, i) => {
      const called = `${kindWords[it.kind]} ${i + 1}`;
      const name = el("input", { type: "text", "aria-label": `Name of ${called}`, maxlength: String(kMaxLetters), placeholder: called });
      name.value = it.name ?? "";
      name.addEventListener("change", () => this.rename(i, name.value));
      const result = viewer.result(it);
      const photos = it.points.map((p, k) => button(String(k + 1), () => measuring.showBestPhoto(p.position), { "aria-label": `Best photo of point ${k + 1} of ${called}` }));
      const remove = button("Remove", () => this.remove(() => state.measurements.splice(i, 1)), { "aria-label": `Remove ${called}` });
      const cells = [kindWords[it.kind], result.text, text(result.parts?.horizontal), text(result.parts?.vertical)].map((word) => el("td", {}, word));
      body.append(el("tr", {}, el("th", { scope: "row" }, name), ...cells, el("td", {}, ...photos), el("td", {}, remove)));
    });
    state.notes.forEach((it, i) => {
      const remove = button("Remove", () => this.remove(() => state.notes.splice(i, 1)), { "aria-label": `Remove note ${i + 1}` });
      const photo = button("1", () => measuring.showBestPhoto(it.position), { "aria-label": `Best photo of note ${i + 1}` });
      const cells = ["Note", "", "", ""].map((word) => el("td", {}, word));
      body.append(el("tr", {}, el("th", { scope: "row" }, it.text), ...cells, el("td", {}, photo), el("td", {}, remove)));
    });
    const head = el("tr", {}, ...["Name", "Kind", "Value", "Horizontal", "Vertical", "Best photo of point", "Remove"].map((word) => el("th", { scope: "col" }, word)));
    return el("table", {}, el("caption", {}, "Measurements and notes, ± is the 95 % bound of the error"), el("thead", {}, head), body);
  }
}
