#version 310 es
// Draws one triangle that covers the whole target.
void main() {
  vec2 corner = vec2(uvec2(uint(gl_VertexID) & 1u, uint(gl_VertexID) >> 1)) * 4.0 - 1.0;
  gl_Position = vec4(corner, 0.0, 1.0);
}
