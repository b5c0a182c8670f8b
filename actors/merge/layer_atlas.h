// LayerAtlas: the blocks of local maps in one R32UI array texture, kept between merges. Needs a current context.
//
// A texel is one word of PackedBlock (16 cells), with rows along x and strips along y. Blocks are packed side by side
// on shelves, and shelves in pages (layers of the array). Maps are immutable, so a block is uploaded once. If the
// texture is full, a new texture is filled with the blocks of all maps that still exist.
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

  // `page_texels_max`: maximum side of a page in texels. A smaller value than kBlockSideCellsMax counts as
  // kBlockSideCellsMax. The side is a power of two and at most the driver's limit.
  explicit LayerAtlas(std::int32_t page_texels_max);

  // Returns the position of a block, after uploading it if necessary. Returns kFull if the driver's maximum number of
  // pages is not enough, and kUnavailable for driver errors.
  Result<Spot> Find(const PlacedBlock& placed);

  // Number of rebuilds of the texture. A rebuild invalidates the positions that Find returned before.
  std::uint64_t generation() const { return generation_; }

  GLuint texture() const { return texture_.id(); }
  std::int32_t page_texels() const { return page_texels_; }  // Side of a page in texels; a power of two.

 private:
  struct Entry {
    std::weak_ptr<const LocalMap> map;  // Weak, because the atlas must not keep a withdrawn map in memory.
    Spot spot;
  };

  bool Reserve(const PackedBlock& block, Spot& spot);
  Result<void> Allocate(std::int32_t pages);
  Result<void> Rebuild();
  void Upload(const PackedBlock& block, const Spot& spot);

  const std::int32_t page_texels_;
  const std::int32_t pages_max_;
  std::int32_t pages_ = 0;
  // Position for the block that is added next.
  Spot next_;
  std::int32_t shelf_height_ = 0;
  GlTexture texture_;
  std::unordered_map<const PackedBlock*, Entry> entries_;
  std::uint64_t generation_ = 0;
};

}  // namespace moondb
