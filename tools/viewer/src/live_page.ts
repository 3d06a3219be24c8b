// SPDX-License-Identifier: BSD-2-Clause
// What the page of a live map shows besides the picture: progress, newest photo, and what is not seen yet.
import { Around } from "./around";
import { button, countText, el, percentText } from "./dom";
import { Follow } from "./follow";
import { Live, type LiveState } from "./live";
import { Seen } from "./seen";
import type { Viewer } from "./viewer";

const words: Record<LiveState, string> = {
  waiting: "Waiting for the first points…",
  running: "",
  done: "The run is done.",
  disconnected: "The run cannot be reached.",
};

/** 65 as "1 min 05 s" */
export function durationText(seconds: number): string {
  const whole = Math.round(Math.max(seconds, 0));
  const two = (x: number): string => String(x).padStart(2, "0");
  if (whole >= 3600) return `${Math.floor(whole / 3600)} h ${two(Math.floor(whole / 60) % 60)} min`;
  return whole >= 60 ? `${Math.floor(whole / 60)} min ${two(whole % 60)} s` : `${whole} s`;
}

export class LivePage {
  readonly live: Live;
  readonly around: Around;
  readonly seen: Seen;
  readonly follow: Follow;
  private readonly photo = el("img", { id: "newest", alt: "", hidden: "" });
  private readonly bar = el("progress", { max: "1", "aria-label": "Progress" });
  private readonly text = el("p", { id: "progress" });
  private readonly followButton = button("Follow", () => this.toggleFollow(), { "aria-pressed": "true" });
  private readonly link = el("a", { hidden: "" }, "Open the report");
  private readonly caption = el("p", {}, "Grey dots: landmarks without points yet. Hatched on the plan: not seen yet.");
  private wasDone = false;

  /** `changed`: called after each update with a message, "" = none. */
  constructor(
    place: HTMLElement,
    private readonly viewer: Viewer,
    pageVersion: number,
    changed: (message: string) => void,
  ) {
    place.append(el("div", { id: "live" }, this.photo, this.bar, this.text, this.link, this.followButton, this.caption));
    this.around = new Around(place, viewer.cloud, () => this.live.camera);
    this.follow = new Follow(viewer.cameras, !viewer.isTouched);
    this.live = new Live(viewer, pageVersion, () => {
      this.update();
      changed(words[this.live.state]);
    });
    this.seen = new Seen(viewer.cloud, () => this.live.eyes(), () => viewer.landmarks, () => viewer.drawOver());
    viewer.overlay.under = (context, project) => {
      if (viewer.state.mode !== "keyframe") this.seen.draw(context, project, viewer.state.mode === "plan");
    };
    viewer.onFramed = () => this.follow.center();
    this.show();
  }

  async start(): Promise<void> {
    await this.live.poll();
    document.addEventListener("visibilitychange", async () => {
      if (!document.hidden && (await this.live.hasRestarted())) location.reload();
    });
  }

  /** "37 % of the cloud: 1 234 of 3 333 points" */
  shareText(): string {
    const { loaded } = this.viewer.cloud;
    const all = Math.max(loaded, this.live.totalPoints);
    return all > 0 ? `${percentText(loaded / all)} of the cloud: ${countText(loaded)} of ${countText(all)} points` : "0 points";
  }

  private update(): void {
    const { live, viewer } = this;
    viewer.landmarks = live.state === "done" ? [] : live.landmarks;
    if (live.camera) this.follow.moved(live.camera.center);
    this.around.changed();
    this.seen.changed();
    if (live.state === "done" && !this.wasDone) {
      this.wasDone = true;
      this.follow.isOn = false;
      if (!viewer.isTouched) viewer.setMode(viewer.state.mode);
    }
    this.show();
  }

  private show(): void {
    const { live } = this;
    const { share, secondsLeft, stage } = live.progress;
    const isOver = live.state === "done";
    this.bar.hidden = share === null || isOver;
    if (share !== null) this.bar.value = share;
    const parts = [share !== null ? percentText(share) : "", secondsLeft !== null ? `${durationText(secondsLeft)} left` : ""];
    const amount = parts.filter((it) => it !== "").join(", ");
    const text = isOver ? "" : [stage, amount].filter((it) => it !== "").join(": ");
    if (this.text.textContent !== text) this.text.textContent = text;
    if (live.newestPhoto && this.photo.getAttribute("src") !== live.newestPhoto.address) {
      this.photo.src = live.newestPhoto.address;
      this.photo.alt = `Newest photo, keyframe ${live.newestPhoto.id}`;
    }
    this.photo.hidden = live.newestPhoto === null;
    this.link.hidden = live.report === "";
    if (live.report !== "") this.link.href = live.report;
    this.followButton.hidden = isOver;
    this.caption.hidden = isOver;
    this.followButton.setAttribute("aria-pressed", String(this.follow.isOn));
  }

  private toggleFollow(): void {
    this.follow.isOn = !this.follow.isOn;
    this.follow.center();
    this.show();
  }
}
