// SPDX-License-Identifier: BSD-2-Clause
// How points are drawn: position, visibility, size and colour; then shading by depth.
import { detailShader } from "./detail";

export const vertexShader = `
precision highp float;
in vec4 position; in vec4 rgbc; in vec4 normal_views;
uniform mat4 modelViewMatrix, projectionMatrix, modelMatrix, viewMatrix;
uniform mat3 basis; uniform vec3 low, high; uniform vec2 heights;
uniform int coloring; uniform bool facing, hasNormals; uniform float size, focalLength, minPointSize, maxPointSize; uniform sampler2D palette;
out vec3 color; flat out vec3 center, facingAlong; flat out float radius;
${detailShader}
vec3 normalOf(vec2 e) {
  vec2 s = mix(e, e - 256.0, step(127.5, e)) / 127.0;
  float w = 1.0 - abs(s.x) - abs(s.y), fold = max(-w, 0.0);
  return normalize(vec3(s.x + (s.x >= 0.0 ? -fold : fold), s.y + (s.y >= 0.0 ? -fold : fold), w));
}
void main() {
  vec3 at = basis * (modelMatrix * vec4(position.xyz, 1.0)).xyz;
  vec4 eye = modelViewMatrix * vec4(position.xyz, 1.0);
  gl_Position = projectionMatrix * eye;
  // Surfaces seen from behind are left out: that opens walls and ceilings.
  vec3 normal = normalize(mat3(modelMatrix) * normalOf(normal_views.xy * 255.0));
  float ahead = projectionMatrix[3][3] == 1.0 ? 1.0 : 0.0;
  vec3 seen = mix(eye.xyz, vec3(0.0, 0.0, -1.0), ahead);
  if (facing && dot(mat3(viewMatrix) * normal, seen) > 0.0) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  center = eye.xyz;
  facingAlong = hasNormals ? mat3(viewMatrix) * normal : -seen;
  if (any(lessThan(at, low)) || any(greaterThan(at, high))) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  gl_PointSize = clamp(size * spacingAt(position.xyz) * focalLength / gl_Position.w, minPointSize, maxPointSize);
  radius = 0.5 * gl_PointSize * gl_Position.w / focalLength;
  float share = coloring == 1 ? (at.z - heights.x) / max(heights.y - heights.x, 1e-9)
              : coloring == 2 ? rgbc.a : (normal_views.z * 255.0 - 1.0) / 9.0;
  color = coloring == 0 ? rgbc.rgb
        : coloring == 4 ? 0.5 + 0.5 * (basis * normal)
        : texture(palette, vec2(clamp(share, 0.0, 1.0) * (255.0 / 256.0) + 0.5 / 256.0, 0.5)).rgb;
}`;

/** A disc along the surface, a little further away at its rim: of discs that overlap, each pixel shows the nearest point. */
export const fragmentShader = `
precision highp float;
uniform mat4 projectionMatrix;
in vec3 color; flat in vec3 center, facingAlong; flat in float radius; out vec4 result;
void main() {
  vec2 p = 2.0 * gl_PointCoord - 1.0;
  float r = dot(p, p);
  if (r > 1.08) discard;
  result = vec4(color, 1.0);
  vec2 off = radius * vec2(p.x, -p.y);
  // Depth of the surface at this pixel, behind that of the center.
  float behind = projectionMatrix[3][3] == 1.0
    ? dot(facingAlong.xy, off) / facingAlong.z
    : center.z - center.z * dot(facingAlong, center) / dot(facingAlong, vec3(center.xy + off, center.z));
  float z = center.z - clamp(behind, -2.0 * radius, 2.0 * radius) - 0.3 * radius * r;
  vec2 clip = vec2(projectionMatrix[2][2], projectionMatrix[2][3]) * z + vec2(projectionMatrix[3][2], projectionMatrix[3][3]);
  gl_FragDepth = 0.5 * clip.x / clip.y + 0.5;
}`;

export const screenVertexShader = `
precision highp float;
in vec3 position;
void main() { gl_Position = vec4(position.xy, 0.0, 1.0); }`;

/**
 * Closes holes of one or two pixels, those with something nearer on both sides in all four directions, and darkens
 * what lies behind its surroundings (after eye-dome lighting: Boucheny 2009; of slopes, only where they change).
 */
export const shadingShader = `
precision highp float;
uniform highp sampler2D colors, depths; uniform vec3 background; uniform float near, far, flatHeight, strength; uniform int radius;
out vec4 result;
const float kNothing = 1e4, kBehind = 0.03, kEven = 0.02, kMost = 0.1;
const ivec2 directions[4] = ivec2[4](ivec2(1, 0), ivec2(0, 1), ivec2(1, 1), ivec2(1, -1));
ivec2 inside(ivec2 p) { return clamp(p, ivec2(0), textureSize(depths, 0) - 1); }
// In octaves; of a flat view in heights of the picture.
float depthAt(ivec2 p) {
  float d = texelFetch(depths, inside(p), 0).r;
  if (d >= 1.0) return kNothing;
  return flatHeight > 0.0 ? d * (far - near) / flatHeight : log2(near * far / (far - d * (far - near)));
}
vec2 sidesAt(ivec2 p, ivec2 by) { return vec2(depthAt(p + by), depthAt(p - by)); }
void main() {
  ivec2 here = ivec2(gl_FragCoord.xy);
  float depth = depthAt(here), nearest = kNothing;
  vec2 sides[4];
  for (int k = 0; k < 4; ++k) {
    sides[k] = sidesAt(here, radius * directions[k]);
    nearest = min(nearest, min(sides[k].x, sides[k].y));
  }
  vec3 color = texelFetch(colors, here, 0).rgb;
  bool isHole = nearest < depth - kBehind;
  for (int k = 0; k < 4 && isHole; ++k) {
    vec2 both = min(sides[k], sidesAt(here, 2 * radius * directions[k]));
    isHole = max(both.x, both.y) < depth - kBehind;
    nearest = min(nearest, min(both.x, both.y));
  }
  if (isHole) {
    vec4 sum = vec4(0.0);
    for (int y = -2; y <= 2; ++y) for (int x = -2; x <= 2; ++x) {
      ivec2 there = inside(here + radius * ivec2(x, y));
      float weight = depthAt(there) < nearest + 2.0 * kBehind ? 1.0 / float(x * x + y * y + 1) : 0.0;
      sum += weight * vec4(texelFetch(colors, there, 0).rgb, 1.0);
    }
    color = sum.rgb / max(sum.a, 1e-6);
    depth = nearest;
  }
  if (depth >= kNothing) { result = vec4(background, 1.0); return; }
  float behind = 0.0;
  for (int k = 0; k < 4; ++k) {
    vec2 steps = clamp(depth - sides[k], -kMost, kMost);
    behind += max(0.0, steps.x + steps.y - kEven);
  }
  result = vec4(color * exp(-strength * behind), 1.0);
}`;
