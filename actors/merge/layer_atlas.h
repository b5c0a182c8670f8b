// LayerAtlas: the layers of local maps as one R8UI array texture, kept between merges.
//
// Blocks stand on shelves, shelves in pages (layers of the array), so that any sizes mix. Maps are immutable, so a map
// is uploaded once; when the texture is full, it is made anew, larger if need be, with the maps of the merge at hand.
// Needs a current context, the destructor too.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "actors/merge/gl_objects.h"
#include "actors/merge/placement.h"

namespace moondb {

class LayerAtlas {
 public:
  struct Spot {
    std::int32_t x = 0;
    std::int32_t y = 0;
    std::int32_t page = 0;
  };

  // `page_cells_max` a side, or the driver's limit.
  explicit LayerAtlas(std::int32_t page_cells_max);

  // Uploads what is not yet there. kFull if the driver's number of pages is not enough, kUnavailable for its errors.
  Result<void> Load(const std::vector<PlacedMap>& maps);

  // Of blocks[index] of a map that the last Load was given.
  const Spot& Find(const std::shared_ptr<const LocalMap>& map, std::size_t index) const {
    return spots_.find(map)->second[index];
  }

  GLuint texture() const { return texture_.id(); }

 private:
  bool Reserve(const LocalMap& map, std::vector<Spot>& spots);
  bool Reserve(const LayerBlock& block, Spot& spot);
  Result<void> Rebuild(const std::vector<PlacedMap>& maps);
  Result<void> CheckUpload();
  void Clear();
  Result<void> Allocate(std::int32_t pages);
  void Upload(const LocalMap& map, const std::vector<Spot>& spots);

  const std::int32_t page_cells_;
  const std::int32_t pages_max_;
  std::int32_t pages_ = 0;
  // Where the next block goes.
  Spot next_;
  std::int32_t shelf_height_ = 0;
  GlTexture texture_;
  // Weak, so that a withdrawn map's memory is freed; ordered by owner, so that an address used again is another map.
  std::map<std::weak_ptr<const LocalMap>, std::vector<Spot>, std::owner_less<>> spots_;
};

}  // namespace moondb
