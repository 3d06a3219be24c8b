// SPDX-License-Identifier: BSD-2-Clause
// Draws points into a picture of their own, part by part, and shows it shaded by depth, under a keyframe's photo.
import {
  type Camera,
  DepthTexture,
  GLSL3,
  Mesh,
  NearestFilter,
  type Object3D,
  OrthographicCamera,
  PlaneGeometry,
  RawShaderMaterial,
  Scene,
  Vector3,
  WebGLRenderTarget,
  WebGLRenderer,
} from "three";
import { screenVertexShader, shadingShader } from "./shaders";
import { isPerspective } from "./sight";

const kBackground = new Vector3(20, 23, 26).divideScalar(255);
const kPollPause = 4; // [ms]

export class Picture {
  readonly renderer: WebGLRenderer;
  private readonly points = new Scene();
  private readonly screen = new Scene();
  private readonly screenCamera = new OrthographicCamera();
  private readonly target = new WebGLRenderTarget(1, 1, {
    minFilter: NearestFilter,
    magFilter: NearestFilter,
    depthTexture: new DepthTexture(1, 1),
  });
  private readonly shading: RawShaderMaterial;
  private readonly quad: Mesh;
  private isLost = false;

  /** `points`, and what lies over them. `restored`: the context was lost and is back. */
  constructor(
    private readonly canvas: HTMLCanvasElement,
    points: Object3D,
    over: Object3D,
    restored: () => void,
  ) {
    this.renderer = new WebGLRenderer({ canvas, antialias: false, powerPreference: "high-performance" });
    this.renderer.autoClear = false;
    this.shading = new RawShaderMaterial({
      glslVersion: GLSL3,
      vertexShader: screenVertexShader,
      fragmentShader: shadingShader,
      depthTest: false,
      depthWrite: false,
      uniforms: {
        colors: { value: this.target.texture },
        depths: { value: this.target.depthTexture },
        background: { value: kBackground },
        near: { value: 1 },
        far: { value: 2 },
        flatHeight: { value: 0 },
        strength: { value: 0 },
        radius: { value: 1 },
      },
    });
    const quad = (this.quad = new Mesh(new PlaneGeometry(2, 2), this.shading));
    quad.frustumCulled = false;
    this.points.add(points);
    this.screen.add(quad, over);
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      this.isLost = true;
    });
    canvas.addEventListener("webglcontextrestored", () => {
      this.isLost = false;
      restored();
    });
  }

  get ratio(): number {
    return this.renderer.getPixelRatio();
  }

  resize(width: number, height: number): void {
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    this.renderer.setSize(width, height, false);
    this.target.setSize(this.canvas.width, this.canvas.height);
  }

  /** Removes all points. */
  clear(): void {
    if (this.isLost) return;
    this.renderer.setRenderTarget(this.target);
    this.renderer.clear();
  }

  /** Adds the points that are visible. */
  add(camera: Camera): void {
    if (this.isLost) return;
    this.renderer.setRenderTarget(this.target);
    this.renderer.render(this.points, camera);
  }

  /** Shows the picture. `flatHeight`: of the part of a flat view that is seen [unit]. */
  present(camera: Camera & { near: number; far: number }, flatHeight: number): void {
    if (this.isLost) return;
    const u = this.shading.uniforms;
    u["near"]!.value = camera.near;
    u["far"]!.value = camera.far;
    u["flatHeight"]!.value = isPerspective(camera) ? 0 : flatHeight;
    u["strength"]!.value = kStrength;
    u["radius"]!.value = Math.max(1, Math.round(this.ratio));
    this.renderer.setRenderTarget(null);
    this.renderer.render(this.screen, this.screenCamera);
  }

  /** Draws the points that are visible, and what lies over them, into another target, not shaded. */
  drawInto(target: WebGLRenderTarget, camera: Camera): void {
    if (this.isLost) return;
    this.renderer.setRenderTarget(target);
    this.renderer.clear();
    this.renderer.render(this.points, camera);
    this.quad.visible = false;
    this.renderer.render(this.screen, this.screenCamera);
    this.quad.visible = true;
    this.renderer.setRenderTarget(null);
  }

  /** Calls `done` once all that was drawn is finished, with the time since [ms]. */
  whenFinished(done: (time: number) => void): void {
    const gl = this.renderer.getContext() as WebGL2RenderingContext;
    const began = performance.now();
    const fence = this.isLost ? null : gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    if (!fence) {
      setTimeout(() => done(0), kPollPause);
      return;
    }
    gl.flush();
    const poll = (): void => {
      if (!this.isLost && gl.getSyncParameter(fence, gl.SYNC_STATUS) === gl.UNSIGNALED) {
        setTimeout(poll, kPollPause);
        return;
      }
      gl.deleteSync(fence);
      done(performance.now() - began);
    };
    setTimeout(poll, kPollPause);
  }
}

/** Of the shading, per octave of depth. */
const kStrength = 4;
