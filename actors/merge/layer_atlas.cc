#include "actors/merge/layer_atlas.h"

#include <algorithm>
#include <bit>
#include <string>
#include <utility>

namespace moondb {
namespace {

// Returns true if both pointers refer to the same object. Equal addresses are not enough: a freed address may be
// reused.
bool IsSame(const std::weak_ptr<const LocalMap>& a, const std::shared_ptr<const LocalMap>& b) {
  return !a.owner_before(b) && !b.owner_before(a);
}

std::int32_t FloorToPowerOfTwo(std::int32_t number) {
  return static_cast<std::int32_t>(std::bit_floor(static_cast<std::uint32_t>(number)));
}

}  // namespace

LayerAtlas::LayerAtlas(std::int32_t page_texels_max)
    : page_texels_(FloorToPowerOfTwo(
          std::min(std::max(page_texels_max, kBlockSideCellsMax), GetGlInteger(GL_MAX_TEXTURE_SIZE)))),
      pages_max_(std::min(GetGlInteger(GL_MAX_ARRAY_TEXTURE_LAYERS), kPagesMax)) {}

Result<LayerAtlas::Spot> LayerAtlas::Find(const PlacedBlock& placed) {
  const std::shared_ptr<const LocalMap>& map = placed.owner->placed.map;
  const auto found = entries_.find(placed.cells);
  if (found != entries_.end() && IsSame(found->second.map, map)) return found->second.spot;
  Entry entry{map, {}};
  if (!Reserve(*placed.cells, entry.spot)) {
    entries_[placed.cells] = std::move(entry);
    if (Result<void> rebuilt = Rebuild(); !rebuilt) return tl::unexpected(rebuilt.error());
    return entries_[placed.cells].spot;
  }
  Upload(*placed.cells, entry.spot);
  const Spot spot = entry.spot;
  entries_[placed.cells] = std::move(entry);
  return spot;
}

// Creates the texture again, with room for about twice the current blocks.
Result<void> LayerAtlas::Rebuild() {
  ++generation_;
  std::erase_if(entries_, [](const auto& entry) { return entry.second.map.expired(); });
  // Compute the layout first, to find how many pages these blocks need.
  next_ = {};
  shelf_height_ = 0;
  pages_ = pages_max_;
  for (auto& [block, entry] : entries_) {
    if (Reserve(*block, entry.spot)) continue;
    entries_.clear();
    texture_ = GlTexture();
    pages_ = 0;
    return Fail(ErrorCode::kFull, "the maps' layers fill more than the driver's " + std::to_string(pages_max_) +
                                      " texture layers of " + std::to_string(page_texels_) +
                                      " texels a side: merge fewer agents or on cpu");
  }
  if (Result<void> allocated = Allocate(std::min(pages_max_, 2 * next_.page + 1)); !allocated) {
    entries_.clear();
    return allocated;
  }
  for (const auto& [block, entry] : entries_) Upload(*block, entry.spot);
  return CheckGl("uploading maps");
}

Result<void> LayerAtlas::Allocate(std::int32_t pages) {
  texture_ = MakeTexture();
  pages_ = pages;
  glBindTexture(GL_TEXTURE_2D_ARRAY, texture_.id());
  glTexStorage3D(GL_TEXTURE_2D_ARRAY, 1, GL_R32UI, page_texels_, page_texels_, pages);
  // Integer textures cannot be filtered. With the default filter the texture is incomplete and reads 0.
  glTexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  glTexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  Result<void> checked = CheckGl("allocating " + std::to_string(pages) + " pages for maps");
  if (!checked) {
    texture_ = GlTexture();
    pages_ = 0;
  }
  return checked;
}

bool LayerAtlas::Reserve(const PackedBlock& block, Spot& spot) {
  const std::int32_t width = block.strip_words();
  const std::int32_t height = block.strip_count();
  Spot next = next_;
  std::int32_t shelf_height = shelf_height_;
  if (next.x + width > page_texels_) {
    next.x = 0;
    next.y += shelf_height;
    shelf_height = 0;
  }
  if (next.y + height > page_texels_) {
    next = {0, 0, next.page + 1};
    shelf_height = 0;
  }
  if (next.page >= pages_) return false;
  spot = next;
  next_ = {next.x + width, next.y, next.page};
  shelf_height_ = std::max(shelf_height, height);
  return true;
}

void LayerAtlas::Upload(const PackedBlock& block, const Spot& spot) {
  glBindTexture(GL_TEXTURE_2D_ARRAY, texture_.id());
  glPixelStorei(GL_UNPACK_ALIGNMENT, 4);
  glTexSubImage3D(GL_TEXTURE_2D_ARRAY, 0, spot.x, spot.y, spot.page, block.strip_words(), block.strip_count(), 1,
                  GL_RED_INTEGER, GL_UNSIGNED_INT, block.words());
}

}  // namespace moondb
