// SPDX-License-Identifier: BSD-2-Clause
// What pmsp-densify puts into the page; src/export/page_cloud.h has the points.
import type { Pose, Vec3 } from "./geometry";

export interface NodeData {
  level: number;
  /** From the origin. */
  corner: Vec3;
  side: number;
  points: number;
}

export interface KeyframeData extends Pose {
  /** In a live page a text, since numbers above 2^53 are rounded. */
  id: number | string;
  /** "depth map", "blurred", ... */
  use: string;
  /** In words, of one that is left out. */
  reason?: string;
  /** Shares of the unmasked panorama. */
  coverage?: number;
  confidence?: number;
  /** Names of images in the page. */
  panorama?: string;
  /** Address of a photo, relative to the page; only where it is served. */
  photo?: string;
  /** Of the depth map with the panorama, and with the photo. */
  depths?: string;
  photo_depths?: string;
  strip?: { image?: string; depth?: string; confidence?: string; near?: number; far?: number };
}

export interface ReportData {
  format: string;
  version: number;
  title: string;
  generator: string;
  unit: string;
  up: Vec3;
  origin: Vec3;
  /** Where north is, if it is known. */
  north?: Vec3;
  points_in: number;
  points: number;
  nodes: NodeData[];
  /** Address of the Potree folder of the same cloud, relative to the page. */
  potree?: string;
  /** Whether the points have normals. */
  normals?: boolean;
  keyframes: KeyframeData[];
  /** Input of `convert` that gives the cloud of the page. */
  convert?: string;
  confidences: number[];
  /** Angle of a pixel of the depth maps [rad]. */
  pixel: number;
  /** Of the two lenses of the camera, along its forward axis; 0 = one centre. */
  lens_distance?: number;
  coverage_map?: { width: number; height: number; depth_maps: number; shares: string };
  facts: [string, string][];
  times: [string, number][];
  problems: string[];
  notes: string[];
  /** Live page only: version of the page; the page reloads if it changes. */
  live_page_version?: number;
}

export const kNoKeyframe = 65535;
export const kPointBytes = 15;

/** Points of a cube, in the layout of the vertex buffers. */
export interface NodePoints {
  count: number;
  /** x, y, z, 0 per point; 0 to 65535 along the cube's side. */
  positions: Uint16Array<ArrayBuffer>;
  /** red, green, blue, confidence */
  colors: Uint8Array<ArrayBuffer>;
  /** Per point: octahedral normal (2), views, 0. */
  normalsAndViews: Uint8Array<ArrayBuffer>;
  keyframes: Uint16Array<ArrayBuffer>;
}

export function bytesFromBase64(text: string): Uint8Array<ArrayBuffer> {
  const binary = atob(text.trim());
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; ++i) bytes[i] = binary.charCodeAt(i);
  return bytes;
}

export function nodePoints(bytes: Uint8Array<ArrayBuffer>, count: number): NodePoints {
  if (bytes.length !== count * kPointBytes) {
    throw new Error(`a block of the cloud has ${bytes.length} bytes; expected ${count * kPointBytes}`);
  }
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const positions = new Uint16Array(4 * count);
  const colors = new Uint8Array(4 * count);
  const normalsAndViews = new Uint8Array(4 * count);
  const keyframes = new Uint16Array(count);
  for (let i = 0; i < count; ++i) {
    for (let k = 0; k < 3; ++k) {
      positions[4 * i + k] = view.getUint16(6 * i + 2 * k, true);
      colors[4 * i + k] = bytes[6 * count + 3 * i + k] ?? 0;
    }
    colors[4 * i + 3] = bytes[9 * count + i] ?? 0;
    normalsAndViews[4 * i] = bytes[11 * count + 2 * i] ?? 0;
    normalsAndViews[4 * i + 1] = bytes[11 * count + 2 * i + 1] ?? 0;
    normalsAndViews[4 * i + 2] = bytes[10 * count + i] ?? 0;
    keyframes[i] = view.getUint16(13 * count + 2 * i, true);
  }
  return { count, positions, colors, normalsAndViews, keyframes };
}

/** Throws where the page holds none, or one of another version. */
export function readData(document: Document): ReportData {
  const text = document.getElementById("pmsp-data")?.textContent;
  if (!text) throw new Error("this page holds no report");
  const data = JSON.parse(text) as ReportData;
  if (data.format !== "pmsp-report" || data.version !== 1) throw new Error("this page holds a report of another version");
  return data;
}

/** base64 of a block of the page; "" where there is none. */
export const blockText = (document: Document, name: string): string =>
  document.getElementById(`pmsp-${name}`)?.textContent?.trim() ?? "";

/** Address of an image that the page holds. */
export const imageAddress = (document: Document, name: string): string =>
  `data:image/jpeg;base64,${blockText(document, name)}`;
