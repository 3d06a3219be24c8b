// SPDX-License-Identifier: BSD-2-Clause
// The list of measurements and notes below the picture.
import { button, el } from "./dom";
import type { Measurement, ViewState } from "./state";
import { kindWords } from "./words";

/** `text`: what a measurement says. `changed`: one was removed. */
export function listResults(place: HTMLElement, state: ViewState, text: (it: Measurement) => string, changed: () => void): void {
  const row = (words: string, from: unknown[], which: number): HTMLElement => {
    const remove = (): void => {
      from.splice(which, 1);
      changed();
    };
    return el("li", {}, words, button("Remove", remove, { "aria-label": `Remove ${words}` }));
  };
  place.replaceChildren(
    ...state.measurements.map((it, i) => row(`${kindWords[it.kind]}: ${text(it)}`, state.measurements, i)),
    ...state.notes.map((it, i) => row(it.text, state.notes, i)),
  );
}
