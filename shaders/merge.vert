#version 310 es
// One instance is what one block, or one footprint, may say of one tile: a rectangle of pixels of the target, in which
// each tile has a place. Which cells count is decided in merge.frag.
precision highp float;
precision highp int;

layout(location = 0) in uvec2 rectangle;  // First pixel (x | y << 16), and its sides.
layout(location = 1) in uvec4 placed;     // Q10.22 modulo 2^32 at pixel (0, 0): u, v, step_cos, step_sin.
layout(location = 2) in uvec4 sides;      // width_q, height_q, corner in the atlas (x | y << 16), page.
layout(location = 3) in uint winner;      // Its number in the tile's list.

uniform vec2 target_size;  // Pixels.

flat out uvec4 block_placed;
flat out uvec4 block_sides;
flat out uint block_winner;

void main() {
  uvec2 corner = uvec2(uint(gl_VertexID) & 1u, uint(gl_VertexID) >> 1);
  uvec2 first = uvec2(rectangle.x & 65535u, rectangle.x >> 16);
  uvec2 extent = uvec2(rectangle.y & 65535u, rectangle.y >> 16);
  vec2 pixel = vec2(first + corner * extent);
  gl_Position = vec4(pixel / target_size * 2.0 - 1.0, 0.0, 1.0);
  block_placed = placed;
  block_sides = sides;
  block_winner = winner;
}
