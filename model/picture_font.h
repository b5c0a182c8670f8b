// A font of 5 x 7 pixels for captions in pictures.
#pragma once

#include <array>
#include <cstdint>

namespace moondb {

inline constexpr int kGlyphWidth = 5;
inline constexpr int kGlyphHeight = 7;

// Seven rows from top to bottom; bit 4 is the leftmost pixel. Small letters come as capitals, strangers as blanks.
using Glyph = std::array<std::uint8_t, kGlyphHeight>;
Glyph GlyphOf(char character);

}  // namespace moondb
