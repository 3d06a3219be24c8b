// SPDX-License-Identifier: BSD-2-Clause
// What a click takes: in a photo the surface that this keyframe saw there, else a point of the cloud; snapped or not.
import { type View, bestPhoto } from "./best_photo";
import type { Depths } from "./depths";
import { type Vec3, thinnest } from "./geometry";
import { KeyframeDepths } from "./keyframe_depths";
import { type Picked, kFewPoints, kRadiusPixels, spreadOnPlanes } from "./measure";
import { hasPhoto } from "./panorama";
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
type Refusal = string;

export class Picking {
  /** Whether points snap to planes, edges and corners. */
  snaps = true;
  private readonly depths: KeyframeDepths;

  constructor(private readonly viewer: Viewer) {
    this.depths = new KeyframeDepths(() => viewer.data.keyframes);
  }

  /** Of the photo that is shown, which may have to be fetched. */
  private get shownDepths(): Depths | null | Promise<Depths | null> {
    const { data, state } = this.viewer;
    return state.mode === "keyframe" && hasPhoto(data.keyframes[state.keyframe]) ? this.depths.of(state.keyframe) : null;
  }

  /** The view has changed: fetches what a click in it needs. */
  prepare(): void {
    void this.shownDepths;
  }

  private photoOf(which: number, depths: Depths | null): Photo | null {
    const keyframe = this.viewer.data.keyframes[which];
    if (!keyframe || !depths) return null;
    const pose = { center: this.viewer.trajectory.centerOf(keyframe), rotation: keyframe.rotation };
    return { depths, pose, keyframe: which, lensDistance: this.viewer.data.lens_distance ?? 0 };
  }

  /** The point at pixels from the upper left corner of the picture. */
  at(x: number, y: number, snaps = this.snaps): Point | Refusal {
    const { viewer } = this;
    const camera = viewer.cameras.current;
    camera.updateMatrixWorld();
    const { along } = rayThrough(camera, (2 * x) / viewer.canvas.clientWidth - 1, 1 - (2 * y) / viewer.canvas.clientHeight);
    const depths = this.shownDepths;
    if (depths instanceof Promise) return "The depth of this photo is still loading; click again in a moment.";
    const photo = this.photoOf(viewer.state.keyframe, depths);
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
  async bestPhoto(position: Vec3): Promise<number | null> {
    const { viewer } = this;
    const views = viewer.data.keyframes.flatMap((keyframe, i): View[] => {
      if (!(keyframe.depths ?? keyframe.photo_depths) || !hasPhoto(keyframe)) return [];
      const pose = { center: viewer.trajectory.centerOf(keyframe), rotation: keyframe.rotation };
      return [{ pose, open: async () => this.photoOf(i, await this.depths.of(i)) }];
    });
    const pixel = pixelAt({ position, keyframe: -1 }, viewer.eyes);
    const near = pointsWithin(viewer.cloud, position, kRadiusPixels * pixel);
    return (await bestPhoto(views, position, near.length >= kFewPoints ? thinnest(near).normal : null))?.keyframe ?? null;
  }
}
