// SPDX-License-Identifier: BSD-2-Clause
// What drags, wheels and keys do to a camera.
import { type PerspectiveCamera, Vector3 } from "three";
import type { Vec3 } from "./geometry";

export interface Head {
  /** Whether one stands at a keyframe, so that drags turn the head. */
  isFree: () => boolean;
  /** Angle of a pixel [rad]. */
  perPixel: () => number;
  turn: (yaw: number, pitch: number) => void;
  /** By degrees of the field of view. */
  zoom: (by: number) => void;
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
      head.zoom(0.15 * (span(before) - span([event.clientX, event.clientY])));
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
      head.zoom(0.03 * event.deltaY);
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
