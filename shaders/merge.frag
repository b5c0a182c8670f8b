#version 310 es
// One pixel is one row of a square: 8 cells of one byte each. A square is 4 x 2 pixels, with its lowest row first. Each
// cell takes the first known value in its square's list of blocks, which is sorted by descending key.
//
// The integers u and v, the same as on the CPU, are the coordinates of a cell's centre in the block, modulo 1024 cells.
// A block has at most 512 cells per side, so one unsigned comparison checks both ends of [0, n).
//
// The sides of `layers` and `lists` are powers of two. Texture coordinates are therefore exact as floats, and samples
// return the stored integers. (texelFetch would compute a mipmap level for each pixel; on llvmpipe this takes 1.5 times
// as long.)
precision highp float;
precision highp int;
precision highp usampler2D;
precision highp usampler2DArray;

uniform usampler2DArray layers;  // A texel holds 16 cells of a row: x is the row, y the strip of 16 columns.
// For each square of the target: the number of its list entries in bits 0 to 5, and the index of the first entry from
// bit 6 on.
uniform usampler2D squares;
// Two texels for each list entry. The first holds u and v of the square's first cell, step_cos and step_sin, in Q10.22
// modulo 2^32. The second holds width_q, height_q, the block's corner in `layers`, and a word with the block's page in
// the low 16 bits and the block's number in the tile in the high 16 bits.
uniform usampler2D lists;
// Sizes of one texel of `layers` and of `lists`, in texture coordinates.
uniform vec2 layers_texel;
uniform vec2 lists_texel;

// Each byte is a cell: its value in bits 0 and 1, and from bit 2 on the number of the winning block.
layout(location = 0) out uvec2 cells;

const uint kListColumns = 1024u;
const uint kFootprintPage = 0xFFFFu;
const uint kAllFree = 0x55555555u;
const uint kOnes = 0x01010101u;

void main() {
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  uint row = uint((pixel.y & 1) * 4 + (pixel.x & 3));
  uint list = texelFetch(squares, pixel >> ivec2(2, 1), 0).r;
  uint index = list >> 6;
  uint end = index + (list & 63u);

  cells = uvec2(0u);
  uvec2 open = uvec2(kOnes);
  for (; index < end && (open.x | open.y) != 0u; ++index) {
    vec2 place = (vec2(ivec2(index % kListColumns * 2u, index / kListColumns)) + 0.5) * lists_texel;
    uvec4 placed = textureLod(lists, place, 0.0);
    uvec4 block = textureLod(lists, place + vec2(lists_texel.x, 0.0), 0.0);
    uint page = block.w & 0xFFFFu;
    bool is_footprint = page == kFootprintPage;
    vec3 corner = vec3((vec2(ivec2(block.z & 0xFFFFu, block.z >> 16)) + 0.5) * layers_texel,
                       is_footprint ? 0.0 : float(int(page)));

    uint u = placed.x + row * placed.w;
    uint v = placed.y + row * placed.z;
    uvec2 seen = uvec2(0u);
    for (int i = 0; i < 8; ++i) {
      vec3 texel = corner + vec3(vec2(ivec2(v >> 22, u >> 26)) * layers_texel, 0.0);
      uint word = is_footprint ? kAllFree : textureLod(layers, texel, 0.0).r;
      uint value = u < block.x && v < block.y ? word >> (u >> 21 & 30u) & 3u : 0u;
      seen[i >> 2] |= value << ((i & 3) * 8);
      u += placed.z;
      v -= placed.w;
    }
    uvec2 taken = (seen | seen >> 1) & open;
    cells |= (seen & taken * 3u) | taken * (block.w >> 16 << 2);
    open &= ~taken;
  }
}
