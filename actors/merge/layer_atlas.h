// LayerAtlas: blocks of local maps as one R32UI array texture, kept between merges.
//
// A texel is a word of PackedBlock, rows along x and strips along y, so that 16 cells take 4 bytes there too. Blocks
// stand on shelves, shelves in pages (layers of the array), so that any sizes mix. Maps are immutable, so a block is
// uploaded once; when the texture is full, it is made anew, larger if need be, with the blocks of maps that still live.
// Needs a current context.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <unordered_map>
#include <vector>

#include "actors/merge/gl_objects.h"
#include "actors/merge/placement.h"

namespace moondb {

class LayerAtlas {
 public:
  static constexpr std::int32_t kPagesMax = 0xFFFF;

  struct Spot {
    std::int32_t x = 0;
    std::int32_t y = 0;
    std::int32_t page = 0;
  };

  // A power of two at most `page_texels_max` a side, at least kBlockSideCellsMax, or the driver's limit.
  explicit LayerAtlas(std::int32_t page_texels_max);

  // Where a block lies, uploaded if need be. kFull if the driver's number of pages is not enough, kUnavailable for its
  // errors.
  Result<Spot> Find(const PlacedBlock& placed);

  // Another number than before: all spots that were found before are void.
  std::uint64_t generation() const { return generation_; }

  GLuint texture() const { return texture_.id(); }
  std::int32_t page_texels() const { return page_texels_; }  // A side; a power of two.

 private:
  struct Entry {
    std::weak_ptr<const LocalMap> map;  // Weak, so that a withdrawn map's memory is freed.
    Spot spot;
  };

  bool Reserve(const PackedBlock& block, Spot& spot);
  Result<void> Allocate(std::int32_t pages);
  Result<void> Rebuild();
  void Upload(const PackedBlock& block, const Spot& spot);

  const std::int32_t page_texels_;
  const std::int32_t pages_max_;
  std::int32_t pages_ = 0;
  // Where the next block goes.
  Spot next_;
  std::int32_t shelf_height_ = 0;
  GlTexture texture_;
  std::unordered_map<const PackedBlock*, Entry> entries_;
  std::uint64_t generation_ = 0;
};

}  // namespace moondb
