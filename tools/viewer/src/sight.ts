// SPDX-License-Identifier: BSD-2-Clause
// What of the scene a camera sees, ball by ball.
import { type Camera, Matrix4, type PerspectiveCamera, Vector3, Vector4 } from "three";

export const isPerspective = (camera: Camera): boolean => (camera as PerspectiveCamera).isPerspectiveCamera === true;

export class Sight {
  private readonly planes: Vector4[];
  private readonly eye = new Vector3();
  private readonly isFlat: boolean;

  constructor(camera: Camera) {
    const matrix = new Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
    this.planes = frustumPlanes(matrix);
    this.eye.setFromMatrixPosition(camera.matrixWorld);
    this.isFlat = !isPerspective(camera);
  }

  /** How large a ball looks: its radius at a distance of 1, or in a flat view its radius; 0 = it is out of the picture. */
  sizeOf(center: Vector3, radius: number): number {
    for (const p of this.planes) {
      if (p.x * center.x + p.y * center.y + p.z * center.z + p.w < -radius) return 0;
    }
    return radius / (this.isFlat ? 1 : Math.max(center.distanceTo(this.eye) - radius, 0.02 * radius));
  }
}

function frustumPlanes(matrix: Matrix4): Vector4[] {
  const e = matrix.elements;
  const row = (i: number): Vector4 => new Vector4(e[i], e[i + 4], e[i + 8], e[i + 12]);
  const w = row(3);
  return [0, 1, 2].flatMap((i) =>
    [w.clone().add(row(i)), w.clone().sub(row(i))].map((p) => p.divideScalar(Math.hypot(p.x, p.y, p.z) || 1)),
  );
}
