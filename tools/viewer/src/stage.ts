// SPDX-License-Identifier: BSD-2-Clause
// The picture with its tools: on a narrow screen the tools are a sheet from below; full screen.
import { button, svg } from "./dom";

export class Stage {
  readonly sheetButton: HTMLButtonElement;
  readonly fullButton: HTMLButtonElement;

  /** `tools`: in the toolbar, or the sheet. `panel`: below the picture, or in the sheet. */
  constructor(
    private readonly stage: HTMLElement,
    tools: HTMLElement,
    panel: HTMLElement,
  ) {
    this.sheetButton = button("Tools", () => this.showSheet(!this.isOpen), { id: "sheet-button", "aria-controls": tools.id });
    this.fullButton = button("", () => this.toggleFull(), { "aria-label": "Full screen", "aria-pressed": "false" });
    const corners = "M2 7V2h5M11 2h5v5M16 11v5h-5M7 16H2v-5";
    const path = svg("path", { d: corners, fill: "none", stroke: "currentColor", "stroke-width": 2 });
    this.fullButton.append(svg("svg", { viewBox: "0 0 18 18", width: 18, height: 18, "aria-hidden": "true" }, path));
    this.showSheet(false);
    const narrow = matchMedia("(max-width: 40rem)");
    const place = (): void => {
      if (narrow.matches) tools.append(panel);
      else stage.append(panel);
    };
    narrow.addEventListener("change", place);
    place();
    tools.addEventListener("click", (event) => {
      if (event.target instanceof HTMLButtonElement && !panel.contains(event.target)) this.showSheet(false);
    });
    stage.addEventListener("keydown", (event) => {
      if (event.key !== "Escape") return;
      if (this.isOpen) this.sheetButton.focus();
      this.showSheet(false);
      if (!document.fullscreenElement) this.setFull(false);
    });
    document.addEventListener("fullscreenchange", () => this.setFull(document.fullscreenElement === stage));
  }

  private get isOpen(): boolean {
    return this.stage.dataset["sheet"] === "open";
  }

  private showSheet(isOpen: boolean): void {
    this.stage.dataset["sheet"] = isOpen ? "open" : "closed";
    this.sheetButton.setAttribute("aria-expanded", String(isOpen));
  }

  private toggleFull(): void {
    const isFull = this.stage.classList.contains("full");
    if (document.fullscreenElement) void document.exitFullscreen();
    else if (!isFull && typeof this.stage.requestFullscreen === "function") {
      // Where it is not allowed, the window is what can be filled.
      this.stage.requestFullscreen().catch(() => this.setFull(true));
    } else this.setFull(!isFull);
  }

  private setFull(isFull: boolean): void {
    this.stage.classList.toggle("full", isFull);
    this.fullButton.setAttribute("aria-pressed", String(isFull));
  }
}
