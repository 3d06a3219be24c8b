// SPDX-License-Identifier: BSD-2-Clause
// How points are drawn: where they are, whether they show, which colour they have.

export const vertexShader = `
precision highp float;
in vec4 position; in vec4 rgbc; in vec4 normal_views;
uniform mat4 modelViewMatrix, projectionMatrix, modelMatrix, viewMatrix;
uniform mat3 basis; uniform vec3 low, high; uniform vec2 heights;
uniform int coloring; uniform bool facing; uniform float size, focalLength, maxPointSize; uniform sampler2D palette;
out vec3 color;
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
  if (any(lessThan(at, low)) || any(greaterThan(at, high))) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  gl_PointSize = clamp(size * focalLength / gl_Position.w, 2.0, maxPointSize);
  float share = coloring == 1 ? (at.z - heights.x) / max(heights.y - heights.x, 1e-9)
              : coloring == 2 ? rgbc.a : (normal_views.z * 255.0 - 1.0) / 9.0;
  color = coloring == 0 ? rgbc.rgb
        : coloring == 4 ? 0.5 + 0.5 * (basis * normal)
        : texture(palette, vec2(clamp(share, 0.0, 1.0) * (255.0 / 256.0) + 0.5 / 256.0, 0.5)).rgb;
}`;

export const fragmentShader = `
precision mediump float;
in vec3 color; out vec4 result;
void main() {
  vec2 p = gl_PointCoord - 0.5;
  if (dot(p, p) > 0.27) discard;
  result = vec4(color, 1.0);
}`;
