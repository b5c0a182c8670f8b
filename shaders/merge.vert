#version 310 es
// One instance is one rectangle: a block of a layer, or a footprint. The quad only has to cover it; which cells count
// is decided in merge.frag.
precision highp float;
precision highp int;

layout(location = 0) in vec4 center_and_x;   // Pixels of the tile: centre, half of the x side (inflated).
layout(location = 1) in vec2 half_y;         // Half of the y side (inflated).
layout(location = 2) in uvec4 placed;        // Q10.22 modulo 2^32 at pixel (0, 0): u, v, step_cos, step_sin.
layout(location = 3) in uvec4 sides;         // width_q, height_q, corner in the atlas (x | y << 16), page.
layout(location = 4) in uvec2 winner;        // slot, level (255: footprint).

uniform vec2 tile_size;  // Pixels.

flat out uvec4 rectangle_placed;
flat out uvec4 rectangle_sides;
flat out uvec2 rectangle_winner;

void main() {
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
  vec2 pixel = center_and_x.xy + corner.x * center_and_x.zw + corner.y * half_y;
  gl_Position = vec4(pixel / tile_size * 2.0 - 1.0, 0.0, 1.0);
  rectangle_placed = placed;
  rectangle_sides = sides;
  rectangle_winner = winner;
}
