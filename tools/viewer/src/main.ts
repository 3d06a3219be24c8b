// SPDX-License-Identifier: BSD-2-Clause
// The page: buttons, keys and the address around the picture.
import { readData } from "./data";
import { button, countText, el, slider } from "./dom";
import { listenForKeys } from "./keys";
import { showLegend } from "./legend";
import { LivePage } from "./live_page";
import { Loupe } from "./loupe";
import { Measuring } from "./measuring";
import { Minimap } from "./minimap";
import { hasPhoto, leaveOutMissingPhotos } from "./panorama";
import { printed } from "./print";
import { writeReport } from "./report";
import { Results } from "./results";
import { Slices } from "./slices";
import { Stage } from "./stage";
import { type Coloring, colorings, type Mode, modes, stateFrom, stateText } from "./state";
import type { StreamState } from "./stream";
import { isOutside } from "./tour";
import { Viewer } from "./viewer";
import { coloringWords, keyWords, modeWords } from "./words";

function byId<T extends HTMLElement>(id: string): T {
  const found = document.getElementById(id);
  if (!found) throw new Error(`the page has no ${id}`);
  return found as T;
}

class Page {
  readonly data = readData(document);
  readonly state = stateFrom(location.hash);
  readonly viewer = new Viewer(this.data, byId("points"), byId("overlay"), this.state);
  live: LivePage | null = null;
  private hasStreamWords = false;
  private liveWords: string | null = null;
  readonly measuring = new Measuring(
    this.viewer,
    this.state,
    (text) => this.say(text),
    () => this.changed(),
    (which, direction) => {
      this.enter(which);
      this.viewer.lookAlong(direction);
    },
  );
  private readonly loupe = new Loupe(byId("view"), this.viewer, () => this.measuring.chosen !== null);
  private addressTimer = 0;
  private readonly modeButtons = new Map<Mode, HTMLButtonElement>();
  private readonly select = el("select", { "aria-label": "Colour by" });
  private readonly legend = el("div", { id: "legend" });
  private readonly message = byId("message");
  private readonly fade = slider("Photo to points", 0, 1, this.state.fade, (v) => {
    this.state.fade = v;
    this.changed();
  });
  private readonly minimap = new Minimap(
    { basis: this.viewer.basis, cloud: this.viewer.cloud, heights: () => this.viewer.planHeights },
    (which) => this.viewer.tour.goTo(which),
  );
  private readonly slices = new Slices(this.viewer, this.state, () => this.changed());
  readonly results = new Results(
    byId("results"),
    this.viewer,
    this.state,
    this.measuring,
    (text) => this.say(text),
    () => this.changed(),
  );
  private readonly where = el("span", { class: "where", "aria-live": "polite" });

  constructor() {
    document.title = this.data.title;
    byId("title").textContent = this.data.title;
    this.tellPoints();
    this.buildToolbar();
    this.buildPanels();
    this.listen();
    writeReport(this.data, byId("report"), this.viewer.basis, (i) => this.enter(i));
    this.viewer.onChange = () => this.refresh();
    this.viewer.onLoaded = () => {
      document.body.dataset["state"] = "loaded";
      if (this.data.live_page_version !== undefined) return this.startPolling(this.data.live_page_version);
      this.say(this.data.points > 0 ? "" : "There are no points.");
      this.refresh();
    };
    this.viewer.onExtent = () => this.minimap.update();
    this.viewer.onStreamed = () => this.streamed();
    this.say("Reading the points…");
    void this.viewer.load();
    void this.checkPhotos();
  }

  private tellPoints(): void {
    const { keyframes, generator, points_in, points } = this.data;
    const { order } = this.viewer.trajectory;
    const covered = order.filter((i) => keyframes[i]?.use === "depth map").length;
    const shown = this.viewer.stream ? this.viewer.cloud.loaded : points;
    byId("subtitle").textContent =
      this.data.live_page_version === undefined
        ? `${countText(shown)} of ${countText(points_in)} points, ${keyframes.length} keyframes, ${generator}`
        : `${this.live?.shareText() ?? "0 points"} of ${covered} of ${order.length} keyframes, ${generator}`;
  }

  /** The Potree folder beside the page has answered. */
  private streamed(): void {
    const stream = this.viewer.stream;
    if (!stream) return;
    document.body.dataset["stream"] = stream.state;
    const words: Partial<Record<StreamState, string>> = {
      lost: "More points cannot be had at the moment.",
      refused: `The Potree folder gives no more points: ${stream.reason}.`,
    };
    if (words[stream.state] !== undefined || this.hasStreamWords) this.say(words[stream.state] ?? "");
    this.hasStreamWords = words[stream.state] !== undefined;
    this.tellPoints();
  }

  /** Starts polling a live map. */
  private startPolling(pageVersion: number): void {
    const live = (this.live = new LivePage(byId("view"), this.viewer, pageVersion, (message) => {
      document.body.dataset["live"] = live.live.state;
      if (message !== this.liveWords) this.say((this.liveWords = message));
      this.tellPoints();
      this.modeButtons.get("walk")!.disabled = this.viewer.trajectory.order.length === 0;
      this.allowPhotos();
      this.refresh();
    }));
    void live.start();
  }

  private allowPhotos(): void {
    this.modeButtons.get("keyframe")!.disabled = !this.data.keyframes.some(hasPhoto);
  }

  /** Photos beside the page that are not served are no longer offered. */
  private async checkPhotos(): Promise<void> {
    if (!(await leaveOutMissingPhotos(this.data.keyframes))) return;
    this.allowPhotos();
    if (this.state.mode === "keyframe") this.viewer.setMode("keyframe", false);
    this.refresh();
  }

  private buildToolbar(): void {
    const views = el("div", { role: "group", "aria-label": "View" });
    for (const mode of modes) {
      const made = button(modeWords[mode], () => this.setMode(mode));
      this.modeButtons.set(mode, made);
      views.append(made);
    }
    if (this.data.keyframes.length === 0) this.modeButtons.get("walk")!.disabled = true;
    this.allowPhotos();
    const flight = el("div", { role: "group", "aria-label": "Keyframe", id: "flight" });
    flight.append(
      button("◀", () => this.viewer.tour.step(-1), { "aria-label": "Previous keyframe" }),
      this.where,
      button("▶", () => this.viewer.tour.step(1), { "aria-label": "Next keyframe" }),
      this.fade,
    );
    for (const coloring of colorings) this.select.append(el("option", { value: coloring }, coloringWords[coloring]));
    this.select.addEventListener("change", () => this.setColoring(this.select.value as Coloring));
    const tools = el(
      "div",
      { id: "tools" },
      el("div", {}, this.select),
      this.measuring.buttons,
      el("div", {}, button("Save picture", () => this.save()), button("Help", () => byId<HTMLDialogElement>("help").showModal())),
    );
    const stage = new Stage(byId("stage"), tools, byId("cuts"));
    byId("toolbar").append(views, stage.sheetButton, tools, stage.fullButton);
    byId("view").append(this.legend, this.minimap.canvas, flight);
  }

  private buildPanels(): void {
    byId("cuts").append(this.slices.box);
    const keys = byId("keys");
    for (const [key, words] of keyWords) keys.append(el("dt", {}, key), el("dd", {}, words));
  }

  private listen(): void {
    const { canvas } = this.viewer;
    let down: [number, number] | null = null;
    canvas.addEventListener("pointerdown", (event) => {
      down = event.isPrimary ? [event.clientX, event.clientY] : null;
    });
    canvas.addEventListener("pointerup", (event) => {
      if (!down || Math.hypot(event.clientX - down[0], event.clientY - down[1]) > 6 || event.button !== 0) return;
      const box = canvas.getBoundingClientRect();
      const [x, y] = [event.clientX - box.left, event.clientY - box.top];
      if (this.measuring.chosen) this.measuring.take(x, y, event.shiftKey);
      else this.clickRing(x, y, event.pointerType === "mouse" ? 6 : 22);
    });
    canvas.addEventListener("dblclick", (event) => {
      if (!this.measuring.chosen) this.viewer.setPivotAt(event.offsetX, event.offsetY);
    });
    listenForKeys(canvas, this);
    window.addEventListener("hashchange", () => {
      if (location.hash.replace(/^#/, "") === stateText(this.state)) return;
      const next = stateFrom(location.hash);
      if (next.isAlongPath !== this.state.isAlongPath) location.reload();
      Object.assign(this.state, next);
      this.viewer.setMode(this.state.mode, this.state.eye === null);
      this.refresh();
    });
    const print = byId<HTMLImageElement>("print");
    window.addEventListener("beforeprint", () => {
      const { picture, width } = printed(this.viewer);
      print.style.width = width === null ? "" : `${width}mm`;
      print.src = picture.toDataURL("image/png");
    });
  }

  fadeBy(by: number): void {
    this.state.fade = Math.max(0, Math.min(1, this.state.fade + by));
    this.changed();
  }

  nextColoring(): void {
    this.setColoring(colorings[(colorings.indexOf(this.state.coloring) + 1) % colorings.length] ?? "photo");
  }

  setMode(mode: Mode): void {
    if (this.modeButtons.get(mode)?.disabled) return;
    this.viewer.setMode(mode);
    this.refresh();
  }

  private enter(which: number): void {
    const photo = hasPhoto(this.data.keyframes[which]);
    this.state.mode = photo ? "keyframe" : "walk";
    this.state.keyframe = which;
    this.viewer.setMode(this.state.mode);
    this.viewer.enter(which, photo, true);
    byId("view").scrollIntoView();
    this.refresh();
  }

  /** Goes to the keyframe whose ring was clicked; from outside into its photo, or where it has none, to its place. */
  private clickRing(x: number, y: number, reach: number): void {
    const which = this.viewer.overlay.keyframeAt(x, y, reach);
    if (which < 0) return;
    if (isOutside(this.state.mode)) this.enter(which);
    else this.viewer.tour.goTo(which);
    this.refresh();
  }

  setColoring(coloring: Coloring): void {
    this.state.coloring = coloring;
    this.changed();
  }

  save(): void {
    this.viewer.picture().toBlob((blob) => {
      if (!blob) return;
      const address = URL.createObjectURL(blob);
      const link = el("a", { href: address, download: "points.png" });
      link.click();
      setTimeout(() => URL.revokeObjectURL(address), 1000);
    });
  }

  private say(text: string): void {
    this.message.textContent = text;
  }

  private changed(): void {
    this.viewer.redraw();
    this.refresh();
  }

  private refresh(): void {
    const { state } = this;
    for (const [mode, made] of this.modeButtons) made.setAttribute("aria-pressed", String(mode === state.mode));
    this.measuring.refresh();
    this.loupe.changed();
    this.select.value = state.coloring;
    const atKeyframe = state.mode === "walk" || state.mode === "keyframe";
    byId("flight").hidden = !atKeyframe;
    this.fade.hidden = state.mode !== "keyframe";
    (this.fade.querySelector("input") as HTMLInputElement).value = String(state.fade);
    const id = this.data.keyframes[state.keyframe]?.id;
    const where = id === undefined ? "" : `keyframe ${id}`;
    if (this.where.textContent !== where) this.where.textContent = where;
    this.slices.refresh();
    this.minimap.show(this.viewer.position);
    showLegend(this.legend, state.coloring, this.viewer.cloud, this.viewer.scale);
    this.results.refresh();
    window.clearTimeout(this.addressTimer);
    this.addressTimer = window.setTimeout(() => {
      history.replaceState(null, "", `#${stateText(state)}`);
    }, 200);
  }
}

declare global {
  interface Window {
    /** For tests and for the console. */
    pmspPage?: Page;
  }
}

try {
  window.pmspPage = new Page();
} catch (error) {
  const text = error instanceof Error ? error.message : String(error);
  byId("message").textContent = `The points cannot be shown: ${text}`;
  document.body.dataset["state"] = "failed";
  if (byId("report").childElementCount === 0) {
    try {
      const data = readData(document);
      byId("title").textContent = document.title = data.title;
      writeReport(data, byId("report"), [[1, 0, 0], [0, 1, 0], [0, 0, 1]], () => {});
    } catch {
      // the message says it
    }
  }
}
