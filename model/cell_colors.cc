#include "model/cell_colors.h"

namespace moondb {

const std::array<Color, 3>& CellColors() {
  static constexpr std::array<Color, 3> kColors = {{{146, 148, 154}, {243, 241, 235}, {120, 8, 14}}};
  return kColors;
}

Image CellPicture(const MergedMap& map) {
  Image image(map.grid.width, map.grid.height, 1);
  for (int row = 0; row < image.height; ++row) {
    for (int column = 0; column < image.width; ++column) {
      *image.At(column, row) = static_cast<std::uint8_t>(map.grid.At(column, image.height - 1 - row));
    }
  }
  return image;
}

}  // namespace moondb
