#version 310 es
// The same integer additions as the CPU's: u and v of this cell's centre in the rectangle, modulo 1024 cells. A block
// has at most 512 a side, so unsigned comparison answers both ends of [0, n).
//
// Rectangles come with the largest key first. What is drawn closes its pixel for the rest by the depth test; unknown
// is discarded and leaves it open. Hence no early_fragment_tests: they would close it before the discard.
precision highp float;
precision highp int;
precision highp usampler2DArray;

uniform usampler2DArray layers;

flat in uvec4 rectangle_placed;
flat in uvec4 rectangle_sides;
flat in uvec2 rectangle_winner;

layout(location = 0) out uvec4 cell;  // Value, slot's low and high byte, level.

const uint kFootprintLevel = 255u;
const uint kFree = 1u;

void main() {
  uvec2 pixel = uvec2(gl_FragCoord.xy);
  uint u = rectangle_placed.x + pixel.x * rectangle_placed.z + pixel.y * rectangle_placed.w;
  uint v = rectangle_placed.y - pixel.x * rectangle_placed.w + pixel.y * rectangle_placed.z;
  if (u >= rectangle_sides.x || v >= rectangle_sides.y) discard;

  uint value = kFree;
  if (rectangle_winner.y != kFootprintLevel) {
    ivec2 corner = ivec2(int(rectangle_sides.z & 65535u), int(rectangle_sides.z >> 16));
    ivec3 texel = ivec3(corner + ivec2(int(u >> 22), int(v >> 22)), int(rectangle_sides.w));
    value = texelFetch(layers, texel, 0).r;
  }
  if (value == 0u) discard;
  cell = uvec4(value, rectangle_winner.x & 255u, rectangle_winner.x >> 8, rectangle_winner.y);
}
