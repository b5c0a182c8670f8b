#include "actors/merge/layer_atlas.h"

#include <algorithm>
#include <string>
#include <utility>

namespace moondb {

LayerAtlas::LayerAtlas(std::int32_t page_cells_max)
    : page_cells_(std::min(page_cells_max, GetGlInteger(GL_MAX_TEXTURE_SIZE))),
      pages_max_(GetGlInteger(GL_MAX_ARRAY_TEXTURE_LAYERS)) {}

Result<void> LayerAtlas::Load(const std::vector<PlacedMap>& maps) {
  if (texture_.id() == 0) {
    if (Result<void> allocated = Allocate(1); !allocated) return allocated;
  }
  glBindTexture(GL_TEXTURE_2D_ARRAY, texture_.id());
  for (const PlacedMap& placed : maps) {
    if (placed.map->blocks.empty() || spots_.contains(placed.map)) continue;
    std::vector<Spot> spots;
    if (!Reserve(*placed.map, spots)) return Rebuild(maps);
    Upload(*placed.map, spots);
    spots_.emplace(placed.map, std::move(spots));
  }
  return CheckUpload();
}

// What failed may have left holes: begin anew the next time.
Result<void> LayerAtlas::CheckUpload() {
  Result<void> checked = CheckGl("uploading maps");
  if (!checked) Clear();
  return checked;
}

void LayerAtlas::Clear() {
  texture_ = GlTexture();
  spots_.clear();
  next_ = {};
  shelf_height_ = 0;
}

Result<void> LayerAtlas::Rebuild(const std::vector<PlacedMap>& maps) {
  // First only on paper: how many pages these maps take. A quarter more lets the next maps in.
  Clear();
  pages_ = pages_max_;
  for (const PlacedMap& placed : maps) {
    if (placed.map->blocks.empty()) continue;
    std::vector<Spot> spots;
    if (!Reserve(*placed.map, spots)) {
      Clear();
      return Fail(ErrorCode::kFull, "the maps' layers fill more than the driver's " + std::to_string(pages_max_) +
                                        " texture layers of " + std::to_string(page_cells_) +
                                        " cells a side: merge fewer agents or on cpu");
    }
    spots_.emplace(placed.map, std::move(spots));
  }
  const std::int32_t used = next_.page + 1;
  if (Result<void> allocated = Allocate(std::min(pages_max_, used + used / 4 + 1)); !allocated) {
    Clear();
    return allocated;
  }
  for (const PlacedMap& placed : maps) {
    if (!placed.map->blocks.empty()) Upload(*placed.map, spots_.find(placed.map)->second);
  }
  return CheckUpload();
}

Result<void> LayerAtlas::Allocate(std::int32_t pages) {
  texture_ = MakeTexture();
  pages_ = pages;
  glBindTexture(GL_TEXTURE_2D_ARRAY, texture_.id());
  glTexStorage3D(GL_TEXTURE_2D_ARRAY, 1, GL_R8UI, page_cells_, page_cells_, pages);
  // Integers cannot be filtered: without this the texture is incomplete and reads 0.
  glTexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  glTexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  Result<void> checked = CheckGl("allocating " + std::to_string(pages) + " pages for maps");
  if (!checked) texture_ = GlTexture();
  return checked;
}

bool LayerAtlas::Reserve(const LocalMap& map, std::vector<Spot>& spots) {
  spots.resize(map.blocks.size());
  for (std::size_t i = 0; i < map.blocks.size(); ++i) {
    if (!Reserve(map.blocks[i], spots[i])) return false;
  }
  return true;
}

bool LayerAtlas::Reserve(const LayerBlock& block, Spot& spot) {
  if (next_.x + block.width > page_cells_) {
    next_.x = 0;
    next_.y += shelf_height_;
    shelf_height_ = 0;
  }
  if (next_.y + block.height > page_cells_) {
    next_ = {0, 0, next_.page + 1};
    shelf_height_ = 0;
  }
  if (next_.page >= pages_) return false;
  spot = next_;
  next_.x += block.width;
  shelf_height_ = std::max(shelf_height_, block.height);
  return true;
}

void LayerAtlas::Upload(const LocalMap& map, const std::vector<Spot>& spots) {
  glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
  for (std::size_t i = 0; i < map.blocks.size(); ++i) {
    const LayerBlock& block = map.blocks[i];
    const Grid& grid = map.map.layers[block.level].grid;
    glPixelStorei(GL_UNPACK_ROW_LENGTH, grid.width);
    const Cell* corner = grid.cells.data() + static_cast<std::size_t>(block.row) * grid.width + block.column;
    glTexSubImage3D(GL_TEXTURE_2D_ARRAY, 0, spots[i].x, spots[i].y, spots[i].page, block.width, block.height, 1,
                    GL_RED_INTEGER, GL_UNSIGNED_BYTE, corner);
  }
  glPixelStorei(GL_UNPACK_ROW_LENGTH, 0);
}

}  // namespace moondb
