#version 310 es
// The same integer additions as the CPU's: u and v of this cell's centre in the block, modulo 1024 cells. A block has
// at most 512 a side, so unsigned comparison answers both ends of [0, n).
//
// A tile's blocks come with the greatest key first. What is drawn closes its pixel for the rest by the depth test;
// unknown is discarded and leaves it open. Hence no early_fragment_tests: they would close it before the discard.
precision highp float;
precision highp int;
precision highp usampler2DArray;

uniform usampler2DArray layers;  // 16 cells of a row a texel, rows along x, strips of 16 columns along y.

flat in uvec4 block_placed;
flat in uvec4 block_sides;
flat in uint block_winner;

layout(location = 0) out uint cell;  // Value, and from bit 8 on the winner.

const uint kFootprintPage = 0xFFFFFFFFu;

void main() {
  uvec2 pixel = uvec2(gl_FragCoord.xy);
  uint u = block_placed.x + pixel.x * block_placed.z + pixel.y * block_placed.w;
  uint v = block_placed.y - pixel.x * block_placed.w + pixel.y * block_placed.z;
  if (u >= block_sides.x || v >= block_sides.y) discard;

  uint value = 1u;
  if (block_sides.w != kFootprintPage) {
    uvec2 texel = uvec2(block_sides.z & 65535u, block_sides.z >> 16) + uvec2(v >> 22, u >> 26);
    uint word = texelFetch(layers, ivec3(ivec2(texel), int(block_sides.w)), 0).r;
    value = word >> (u >> 21 & 30u) & 3u;
  }
  if (value == 0u) discard;
  cell = value | block_winner << 8;
}
