// The map codec: the cells of local traversability maps, coded without loss by the cells about them, by the coarser
// layer, and by an earlier map of the same run.
//
// A run is a row of maps whose coding goes on learning from one to the next; it travels as one string or several, which
// the decoder must take in the same order. It begins with what was learnt from generated maps, and begins anew by
// itself where the next map would be one too many for it. Of a map only the cells are coded: sizes and resolutions must
// be told to the decoder beforehand.
//
//   map        := reference placement? nested* layer* checksum        (all in one stream of the range coder)
//   reference  := 0 | 1, 5 bits: how many maps back, less one
//   placement  := x and y (12 bits each), yaw (10 bits)               (placement.h)
//   nested     := 1 bit for each layer with a coarser one: its hazards lie only where that has hazards
//   layer      := the cells, coarsest layer first                     (layer_coder.h)
//   checksum   := the low 16 bits of XXH64 over all cells, finest layer first
//
// Everything is in whole numbers, so that each end gets the same on every compiler and processor. A change to anything
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "actors/sharing/coding/bit_model.h"
#include "actors/sharing/coding/placement.h"
#include "actors/sharing/coding/previous_trials.h"
#include "actors/sharing/coding/range_coder.h"
#include "actors/sharing/coding/ray_table.h"
#include "model/error.h"
#include "model/grid.h"

namespace moondb {

inline constexpr std::size_t kRunMapsMax = 32;
inline constexpr std::uint64_t kRunCellsMax = 4 * 1024 * 1024;   // Of a run's maps, all of which both ends keep.
inline constexpr std::uint64_t kCodedCellsMax = kRunCellsMax;    // Of one string's maps: half a second to decode.
inline constexpr std::uint64_t kCodedMapCellsMax = 1024 * 1024;  // Of one map.
inline constexpr std::int32_t kCodedMapSideMax = 4096;           // Of a layer.

// Whether these layers' sizes are within the limits above and those of grid.h; other maps have to travel
// in another form. Looks at no cell.
bool IsCodable(const std::vector<MapLayer>& layers);

// Of all layers.
std::uint64_t CellCountOf(const std::vector<MapLayer>& layers);

// What both ends have of a run: at most 10 MB, or 42 where layers are two cells wide.
class MapRun {
 public:
  // For learning tables; both ends would have to change it alike.
  BitModel& model() { return model_; }

 protected:
  struct Reference {
    std::size_t maps_back = 0;
    MapPlacement placement;
  };

  // `reference`: a codable map that both ends hold already, as if it were the first of the run; null: none.
  explicit MapRun(const std::vector<MapLayer>* reference);

  void MakeRoomFor(const CodedLayers& layers);
  const CodedLayers& EarlierOf(const Reference& reference) const {
    return *earlier_[earlier_.size() - reference.maps_back];
  }
  // Codes all that follows `placement`, fills cells.
  template <typename Coder>
  void CodeCells(const std::optional<Reference>& reference, const CodedLayers& source, Coder& coder, BitModel& model,
                 CodedLayers& cells);
  // Remembers a map that was coded so.
  void Keep(const std::optional<Reference>& reference, CodedLayers layers);

  std::vector<std::shared_ptr<const CodedLayers>> earlier_;  // Newest last; copies of a run share them.
  std::uint64_t earlier_cells_ = 0;
  BitModel model_;

 private:
  RayTable rays_;
};

// Copies can be coded with on trial.
class MapRunEncoder : public MapRun {
 public:
  // kWhereItPays tries it with each map, which takes three times as long as to code the map alone; kWhileItPays rests
  // where it brings little (previous_trials.h). kWherePlaced is for learning: also where it costs more than it brings.
  enum class Previous { kNever, kWhereItPays, kWhileItPays, kWherePlaced };

  // `trials`: what was found out in earlier runs, with kWhileItPays.
  explicit MapRunEncoder(Previous previous, const std::vector<MapLayer>* reference = nullptr,
                         const PreviousTrials& trials = {});

  // Adds a map to the string that Finish returns. IsCodable must hold, every cell must be unknown, free or a hazard,
  // and the string's maps must have no more than kCodedCellsMax cells. `source` tells apart whose map it is: the newest
  // earlier one of the same source is tried as its previous map; a reference is of any.
  void Add(const std::vector<MapLayer>& layers, std::uint32_t source = 0);
  // Of the string so far.
  std::size_t byte_count() const { return coder_.byte_count(); }
  std::string Finish() { return coder_.Finish(); }
  const PreviousTrials& trials() const { return trials_; }

 private:
  PreviousTrials::Way WayOfNext() const;
  // How many maps back the newest one of that source is.
  std::optional<std::size_t> MapsBackTo(std::uint32_t source) const;
  // Codes a map that has a previous one; with which placement of that, if with any.
  std::optional<Reference> CodeBehind(std::size_t maps_back, const CodedLayers& source);
  void Code(const std::optional<Reference>& reference, const CodedLayers& source, RangeEncoder& coder, BitModel& model);
  bool CodeCheaper(const Reference& reference, const CodedLayers& source);

  Previous previous_;
  PreviousTrials trials_;
  std::vector<std::uint32_t> sources_;  // Of the newest earlier maps; a reference has none.
  RangeEncoder coder_;
};

class MapRunDecoder : public MapRun {
 public:
  explicit MapRunDecoder(const std::vector<MapLayer>* reference = nullptr) : MapRun(reference) {}

  // Fills the cells of the next maps of the run, whose layers are as they were at the encoder but for the cells.
  // kCorrupt: sizes beyond the limits, a reference to a map that is not here, a checksum that does not fit, bytes
  // behind the last map. After an error the run is over: every call fails.
  Result<void> Decode(std::string_view coded, std::vector<std::vector<MapLayer>*>& maps);

 private:
  Result<void> DecodeMap(RangeDecoder& coder, std::vector<MapLayer>& layers);

  bool has_failed_ = false;
};

}  // namespace moondb
