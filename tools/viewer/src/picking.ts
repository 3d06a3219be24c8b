// SPDX-License-Identifier: BSD-2-Clause
// What a click takes: in a photo the surface that this keyframe saw there, else a point of the cloud; snapped or not.
import { bestPhoto } from "./best_photo";
import { DepthsOfPage } from "./depths";
import { type Vec3, thinnest } from "./geometry";
import { type Picked, kFewPoints, kRadiusPixels, spreadOnPlanes } from "./measure";
import { type Photo, pickedInPhoto, placesInPhoto } from "./photo_pick";
import { type SnapKind, kSnapPixels, snapped } from "./snap";
import { pixelAt, pointsWithin, rayThrough } from "./surroundings";
import type { Viewer } from "./viewer";

export interface Point {
  picked: Picked;
  /** null = it was not snapped. */
  snap: SnapKind | null;
}
/** Why there is no point, as a sentence. */
export type Refusal = string;

export class Picking {
  /** Whether points snap to planes, edges and corners. */
  snaps = true;
  private readonly depths = new DepthsOfPage(document);

  constructor(private readonly viewer: Viewer) {}

  /** null = the keyframe has no photo, or no depth map. */
  private photoOf(which: number): Photo | null {
    const keyframe = this.viewer.data.keyframes[which];
    const depths = keyframe?.panorama ? this.depths.of(keyframe.depths) : null;
    if (!keyframe || !depths) return null;
    const pose = { center: this.viewer.centerOf(keyframe), rotation: keyframe.rotation };
    return { depths, pose, keyframe: which, lensDistance: this.viewer.data.lens_distance ?? 0 };
  }

  /** The point at pixels from the upper left corner of the picture. */
  at(x: number, y: number, snaps = this.snaps): Point | Refusal {
    const { viewer } = this;
    const camera = viewer.cameras.current;
    camera.updateMatrixWorld();
    const { along } = rayThrough(camera, (2 * x) / viewer.canvas.clientWidth - 1, 1 - (2 * y) / viewer.canvas.clientHeight);
    const photo = viewer.state.mode === "keyframe" ? this.photoOf(viewer.state.keyframe) : null;
    const found = photo ? pickedInPhoto(photo, along) : viewer.pick(x, y);
    if (!found) return "There is no point here.";
    if (typeof found === "string") return found;
    // What lies behind the surface of the photo was not meant, even if that is cut away.
    if (viewer.cloud.isCut(found.position)) return "The surface here is cut away.";
    const { front, rim, ...picked } = found;
    if (!snaps) return { picked, snap: null };
    const pixel = pixelAt(picked, viewer.eyes);
    const points = photo ? placesInPhoto(photo, found.position, kSnapPixels) : pointsWithin(viewer.cloud, picked.position, kSnapPixels * pixel);
    const to = snapped(points, picked.position, along, pixel);
    if (!to || viewer.cloud.isCut(to.position)) return { picked, snap: null };
    const spread = spreadOnPlanes({ ...picked, front, rim }, to.spread, to.kind === "plane");
    return { picked: { ...picked, position: to.position, spread }, snap: to.kind };
  }

  /** The keyframe whose photo sees a place best; null = none does. */
  bestPhoto(position: Vec3): number | null {
    const { viewer } = this;
    const photos = viewer.data.keyframes.map((_, i) => this.photoOf(i)).filter((it) => it !== null);
    const pixel = pixelAt({ position, keyframe: -1 }, viewer.eyes);
    const near = pointsWithin(viewer.cloud, position, kRadiusPixels * pixel);
    return bestPhoto(photos, position, near.length >= kFewPoints ? thinnest(near).normal : null)?.keyframe ?? null;
  }
}
