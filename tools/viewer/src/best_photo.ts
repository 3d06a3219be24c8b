// SPDX-License-Identifier: BSD-2-Clause
// The photo that sees a point best: near, facing the surface, and with nothing in front.
import type { Photo } from "./photo_pick";
import { type Pose, type Vec3, dot, norm, sub, toCamera, unit } from "./geometry";

/** Relative difference of depths at which a photo shows something else. */
const kSame = 0.03;
/** Depths are looked for around the point [pixels of the depth map]. */
const kAround = 3;
/** A flat angle ranks low, but shows the point. */
const kFlattest = 0.05;

/** Whether the photo's depth map has the point, rather than what lies before or behind it. */
export function sees(photo: Photo, position: Vec3): boolean {
  const ray = toCamera(photo.pose, sub(position, photo.pose.center));
  const distance = norm(ray);
  if (!(distance > 0)) return false;
  const [column, row] = photo.depths.placeOf(ray);
  let nearest = Number.POSITIVE_INFINITY;
  let isFound = false;
  photo.depths.around(column, row, kAround, (c, r) => {
    const depth = photo.depths.at(c, r);
    if (depth === 0) return;
    const off = Math.hypot(c + 0.5 - column, r + 0.5 - row);
    if (off < nearest && off <= 1) [nearest, isFound] = [off, Math.abs(depth - distance) <= kSame * distance];
    else if (nearest > 1 && Math.abs(depth - distance) <= kSame * distance) isFound = true;
  });
  return isFound;
}

/** How well: pixels per length of the surface. `normal`: null = unknown. */
function sharpness(pose: Pose, position: Vec3, normal: Vec3 | null): number {
  const ray = sub(position, pose.center);
  const facing = normal ? Math.abs(dot(unit(ray), normal)) : 1;
  return Math.max(facing, kFlattest) / Math.max(norm(ray), 1e-12);
}

/** A photo that may have to be fetched. */
export interface View {
  pose: Pose;
  open: () => Promise<Photo | null>;
}

/** Opens photos, sharp ones first, until one sees the point; null = none does. */
export async function bestPhoto(views: readonly View[], position: Vec3, normal: Vec3 | null): Promise<Photo | null> {
  const ranked = views.map((view) => ({ view, value: sharpness(view.pose, position, normal) }));
  for (const { view } of ranked.sort((a, b) => b.value - a.value)) {
    const photo = await view.open();
    if (photo && sees(photo, position)) return photo;
  }
  return null;
}
