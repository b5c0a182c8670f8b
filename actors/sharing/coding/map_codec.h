// The map codec: the cells of local traversability maps, coded without loss by the cells about them, by the coarser
// layer, and by an earlier map of the same run.
//
// A run is a row of at most kRunMapsMax maps whose coding goes on learning from one to the next; it travels as one
// string or several, which the decoder must take in the same order. A run begins with what was learnt from generated
// maps. Of a map only the cells are coded: sizes, resolutions and centres must be told to the decoder beforehand.
//
//   map        := reference placement? nested* layer* checksum        (all in one stream of the range coder)
//   reference  := 0 | 1, 5 bits: how many maps back, less one
//   placement  := x and y (12 bits each), yaw (10 bits)               (placement.h)
//   nested     := 1 bit for each layer with a coarser one: its hazards lie only where that has hazards
//   layer      := the cells, coarsest layer first                     (layer_coder.h)
//   checksum   := the low 16 bits of XXH64 over all cells, finest layer first
//
// Everything is in whole numbers, so that each end gets the same on every compiler and processor. A change to anything
// here, to the tables or to the learnt ones, is a new format: see kMapFormatVersion. Not thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "actors/sharing/coding/bit_model.h"
#include "actors/sharing/coding/placement.h"
#include "actors/sharing/coding/range_coder.h"
#include "actors/sharing/coding/ray_table.h"
#include "model/error.h"
#include "model/traversability_map.h"

namespace moondb {

inline constexpr std::uint8_t kMapFormatVersion = 1;
inline constexpr std::size_t kRunMapsMax = 32;
inline constexpr std::uint64_t kCodedMapCellsMax = 1024 * 1024;  // Of all layers of one map: 0.1 s to decode.
inline constexpr std::int32_t kCodedMapSideMax = 4096;           // Of a layer, in cells.
inline constexpr std::uint64_t kRunCellsMax = 4 * 1024 * 1024;   // Of the earlier maps that a run keeps, 1 byte each.

// Whether these layers' sizes are within the limits above and those of traversability_map.h; other maps have to travel
// in another form. Looks at no cell.
bool IsCodable(const std::vector<MapLayer>& layers);

// What both ends of a run have.
class MapRun {
 public:
  // `reference`: a map that both ends hold already, as if it were the first of the run; null: none.
  explicit MapRun(const std::vector<MapLayer>* reference);

  std::size_t map_count() const { return map_count_; }
  // For learning tables; both ends would have to change it alike.
  BitModel& model() { return model_; }

 protected:
  struct Reference {
    std::size_t maps_back = 0;
    Placement placement;
  };

  // Codes all that follows `placement`, fills cells.
  template <typename Coder>
  void CodeCells(const std::optional<Reference>& reference, const CodedLayers& source, Coder& coder, BitModel& model,
                 CodedLayers& cells);
  void Keep(CodedLayers layers);

  BitModel model_;
  RayTable rays_;
  std::deque<CodedLayers> earlier_;  // Newest last.
  std::uint64_t earlier_cells_ = 0;
  std::size_t map_count_ = 0;
};

class MapRunEncoder : public MapRun {
 public:
  // kWherePlaced is for learning: also where it costs more than it brings.
  enum class Previous { kNever, kWhereItPays, kWherePlaced };

  explicit MapRunEncoder(Previous previous, const std::vector<MapLayer>* reference = nullptr)
      : MapRun(reference), previous_(previous) {}

  // Adds a map to the string that Finish returns. IsCodable must hold, map_count() must be below kRunMapsMax, and every
  // cell must be unknown, free or a hazard.
  void Add(const std::vector<MapLayer>& layers);
  // Of the string so far.
  std::size_t byte_count() const { return coder_.byte_count(); }
  std::string Finish() { return coder_.Finish(); }

 private:
  void Code(const std::optional<Reference>& reference, const CodedLayers& source, RangeEncoder& coder, BitModel& model);

  Previous previous_;
  RangeEncoder coder_;
};

class MapRunDecoder : public MapRun {
 public:
  explicit MapRunDecoder(const std::vector<MapLayer>* reference = nullptr) : MapRun(reference) {}

  // Fills the cells of the next maps of the run, whose layers are as they were at the encoder but for the cells.
  // kCorrupt: sizes beyond the limits, more maps than a run has, a reference to a map that is not here, a checksum that
  // does not fit, bytes behind the last map. After an error the run is over: every call fails.
  Result<void> Decode(std::string_view coded, std::vector<std::vector<MapLayer>*>& maps);

 private:
  Result<void> DecodeMap(RangeDecoder& coder, std::vector<MapLayer>& layers);

  bool has_failed_ = false;
};

}  // namespace moondb
