// A font of 5 x 7 pixels for captions in pictures.
#pragma once

#include <array>
#include <cstdint>

namespace moondb {

inline constexpr int kGlyphWidth = 5;
inline constexpr int kGlyphHeight = 7;

// A character's pixels as seven rows from top to bottom; bit 4 of a row is the leftmost pixel. Lower-case letters are
// drawn as capitals, and unknown characters as blanks.
using Glyph = std::array<std::uint8_t, kGlyphHeight>;
Glyph GlyphOf(char character);

}  // namespace moondb
