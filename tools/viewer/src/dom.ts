// SPDX-License-Identifier: BSD-2-Clause
// Elements. Text goes in as text, never as HTML: names of files and keyframes come from a mission.

type Child = Node | string | null | false;

export function el<K extends keyof HTMLElementTagNameMap>(
  name: K,
  attributes: Record<string, string> = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  for (const child of children) if (child) made.append(child);
  return made;
}

export function svg(name: string, attributes: Record<string, string | number>, ...children: (Node | string)[]): SVGElement {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, String(value));
  made.append(...children);
  return made;
}

/** 1234567 as "1 234 567" */
export const countText = (count: number): string => String(Math.round(count)).replace(/\B(?=(\d{3})+(?!\d))/g, " ");
export const percentText = (share: number): string => `${(100 * share).toFixed(share < 0.1 ? 1 : 0)} %`;

export function button(words: string, act: () => void, attributes: Record<string, string> = {}): HTMLButtonElement {
  const made = el("button", { type: "button", ...attributes }, words);
  made.addEventListener("click", act);
  return made;
}

export function slider(words: string, low: number, high: number, value: number, act: (value: number) => void): HTMLLabelElement {
  const input = el("input", { type: "range", min: String(low), max: String(high), step: "any", value: String(value) });
  input.addEventListener("input", () => act(Number(input.value)));
  return el("label", {}, el("span", {}, words), input);
}
