// SPDX-License-Identifier: BSD-2-Clause
// What drags, wheels and keys do to a camera.
import { type PerspectiveCamera, Vector3 } from "three";
import { type Vec3, add, times } from "./geometry";

interface Head {
  /** Whether one stands at a keyframe, so that drags turn the head. */
  isFree: () => boolean;
  /** Angle of a pixel [rad]. */
  perPixel: () => number;
  turn: (yaw: number, pitch: number) => void;
  /** By degrees of the field of view; what is seen at `x` and `y` [px] stays there. */
  zoom: (by: number, x: number, y: number) => void;
}

export function listenForLooking(canvas: HTMLCanvasElement, head: Head): void {
  const held = new Map<number, [number, number]>();
  canvas.addEventListener("pointerdown", (event) => {
    if (head.isFree()) held.set(event.pointerId, [event.clientX, event.clientY]);
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = held.get(event.pointerId);
    if (!before || !head.isFree()) return;
    const others = [...held].filter(([id]) => id !== event.pointerId);
    held.set(event.pointerId, [event.clientX, event.clientY]);
    const other = others[0]?.[1];
    if (other) {
      const span = (p: [number, number]): number => Math.hypot(p[0] - other[0], p[1] - other[1]);
      const by = 0.15 * (span(before) - span([event.clientX, event.clientY]));
      const box = canvas.getBoundingClientRect();
      head.zoom(by, (event.clientX + other[0]) / 2 - box.left, (event.clientY + other[1]) / 2 - box.top);
      return;
    }
    const scale = head.perPixel();
    head.turn((event.clientX - before[0]) * scale, (event.clientY - before[1]) * scale);
  });
  for (const name of ["pointerup", "pointercancel", "pointerleave"] as const) {
    canvas.addEventListener(name, (event) => held.delete(event.pointerId));
  }
  canvas.addEventListener(
    "wheel",
    (event) => {
      if (!head.isFree()) return;
      event.preventDefault();
      head.zoom(0.03 * event.deltaY, event.offsetX, event.offsetY);
    },
    { passive: false },
  );
}

/** Arrow keys and buttons, where one looks from outside. */
export function nudgeOrbit(
  camera: PerspectiveCamera,
  target: Vector3,
  upward: Vec3,
  right: number,
  up: number,
  closer: number,
): void {
  const axis = new Vector3(...upward);
  const off = camera.position.clone().sub(target);
  off.applyAxisAngle(axis, 0.15 * right);
  const across = off.clone().cross(axis).normalize();
  const lifted = off.clone().applyAxisAngle(across, 0.1 * up);
  if (Math.abs(lifted.clone().normalize().dot(axis)) < 0.995) off.copy(lifted);
  off.multiplyScalar(0.8 ** closer);
  camera.position.copy(target).add(off);
}

/** Right, ahead and up, of keys that are held. */
const walkingKeys: Record<string, Vec3> = {
  w: [0, 1, 0],
  s: [0, -1, 0],
  a: [-1, 0, 0],
  d: [1, 0, 0],
  e: [0, 0, 1],
  q: [0, 0, -1],
};
const kLongestStep = 0.1; // [s]

/** Calls `walk` each frame while W, A, S, D, E or Q are held, with right, ahead and up times the time [s]. */
export class Walking {
  private readonly held = new Set<string>();
  private last = 0;

  constructor(
    canvas: HTMLCanvasElement,
    private readonly walk: (by: Vec3) => void,
  ) {
    canvas.addEventListener("keydown", (event) => {
      const key = event.key.toLowerCase();
      if (!walkingKeys[key] || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      if (this.held.has(key)) return;
      this.held.add(key);
      if (this.held.size > 1) return;
      this.last = performance.now();
      this.walk(this.direction.map((x) => x * 0.016) as [number, number, number]); // a short press counts, too
      requestAnimationFrame((now) => this.next(now));
    });
    canvas.addEventListener("keyup", (event) => this.held.delete(event.key.toLowerCase()));
    canvas.addEventListener("blur", () => this.held.clear());
  }

  get isActive(): boolean {
    return this.held.size > 0;
  }

  private get direction(): Vec3 {
    let sum: Vec3 = [0, 0, 0];
    for (const key of this.held) sum = add(sum, walkingKeys[key] ?? [0, 0, 0]);
    return sum;
  }

  private next(now: number): void {
    if (!this.isActive) return;
    this.walk(times(this.direction, Math.max(0, Math.min(kLongestStep, (now - this.last) / 1000))));
    this.last = now;
    requestAnimationFrame((then) => this.next(then));
  }
}
