// The map codec: lossless coding of the cells of local traversability maps (occupancy grids). Each cell is predicted
// from the cells around it, from the coarser layer, and from an earlier map of the same run.
//
// A run is a sequence of maps whose model keeps adapting from one map to the next, starting from TrainedModel(). A run
// is sent as one or several strings, which the decoder must decode in the same order. If the next map would exceed the
// run's limits, encoder and decoder each restart the run. Only the cells of a map are coded. The decoder must know the
// sizes and resolutions of the layers beforehand.
//
//   map        := reference placement? nested* layer* checksum        (all in one stream of the range coder)
//   reference  := 0 | 1, 5 bits: how many maps back, less one
//   placement  := x and y (12 bits each), yaw (10 bits)               (placement.h)
//   nested     := 1 bit for each layer with a coarser one: its hazards lie only in hazards of that layer
//   layer      := the cells, coarsest layer first                     (layer_coder.h)
//   checksum   := the low 16 bits of XXH64 over all cells, finest layer first
//
// All arithmetic uses integers, so every compiler and processor computes the same. Any change to the format, the
// predictions or the initial model changes the wire format (model/wire_version.h). Not thread-safe.
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
inline constexpr std::uint64_t kRunCellsMax = 4 * 1024 * 1024;  // Limit of the cells in all maps of a run.
// Cells of all maps in one coded string. Decoding that many cells takes about half a second.
inline constexpr std::uint64_t kCodedCellsMax = kRunCellsMax;
inline constexpr std::uint64_t kCodedMapCellsMax = 1024 * 1024;  // Cells of all layers of one map.
inline constexpr std::int32_t kCodedMapSideMax = 4096;           // Width and height of a layer, in cells.

// Returns true if the layers' sizes are within the limits above and those of grid.h. All other maps must be sent in
// another form. Does not read the cells.
bool IsCodable(const std::vector<MapLayer>& layers);

// Returns the number of cells of all layers.
std::uint64_t CellCountOf(const std::vector<MapLayer>& layers);

// The state of a run, which is the same at encoder and decoder. Takes at most 10 MB, or 42 MB if layers are two cells
// wide.
class MapRun {
 public:
  // Only for training. In all other uses, encoder and decoder would have to change the model in the same way.
  BitModel& model() { return model_; }

 protected:
  struct Reference {
    std::size_t maps_back = 0;
    MapPlacement placement;
  };

  // `reference`: a map that both the encoder and the decoder already hold. It becomes the first map of the run. Null:
  // the run starts empty. Requires: IsCodable(*reference), if not null.
  explicit MapRun(const std::vector<MapLayer>* reference);

  void MakeRoomFor(const CodedLayers& layers);
  const CodedLayers& EarlierOf(const Reference& reference) const {
    return *earlier_[earlier_.size() - reference.maps_back];
  }
  // Codes the cells of a map and fills `cells`. For each layer with a coarser one, first codes one bit: whether its
  // hazards lie only in hazards of the coarser layer (`nested` in the format above).
  template <typename Coder>
  void CodeCells(const std::optional<Reference>& reference, const CodedLayers& source, Coder& coder, BitModel& model,
                 CodedLayers& cells);
  // Adds a map that was coded with this reference to the earlier maps of the run.
  void Keep(const std::optional<Reference>& reference, CodedLayers layers);

  std::vector<std::shared_ptr<const CodedLayers>> earlier_;  // Earlier maps, newest last; shared by copies of a run.
  std::uint64_t earlier_cells_ = 0;
  BitModel model_;

 private:
  RayTable rays_;
};

// Encodes the maps of a run. An encoder can be copied to encode a map on trial.
class MapRunEncoder : public MapRun {
 public:
  // How the previous map of the same source is used to predict a map.
  //   kNever         Codes each map alone.
  //   kWhereItPays   Codes each map with and without its previous map, and keeps the smaller result. Takes three times
  //                  as long as kNever.
  //   kWhileItPays   Like kWhereItPays, but skips the comparison for some maps if it gains little (previous_trials.h).
  //   kWherePlaced   Uses the previous map whenever it can be placed, even if that costs bytes. For training.
  enum class Previous { kNever, kWhereItPays, kWhileItPays, kWherePlaced };

  // `trials`: results of trials in earlier runs; used with kWhileItPays.
  explicit MapRunEncoder(Previous previous, const std::vector<MapLayer>* reference = nullptr,
                         const PreviousTrials& trials = {});

  // Adds a map to the string that Finish returns. `source` identifies the map's origin. The newest earlier map of the
  // same source serves as the previous map; if there is none, the reference does. Requires: IsCodable(layers), every
  // cell is unknown, free or a hazard, and the string's maps have at most kCodedCellsMax cells.
  void Add(const std::vector<MapLayer>& layers, std::uint32_t source = 0);
  // Returns the size in bytes of the coded string so far.
  std::size_t byte_count() const { return coder_.byte_count(); }
  std::string Finish() { return coder_.Finish(); }
  const PreviousTrials& trials() const { return trials_; }

 private:
  PreviousTrials::Way WayOfNext() const;
  // Returns the position of the source's newest map among the earlier maps of the run, counted back from 1 for the
  // newest map. If the run has no map of the source, returns the position of the reference. Returns nullopt if the run
  // has no reference either.
  std::optional<std::size_t> MapsBackTo(std::uint32_t source) const;
  // Codes a map that has a previous map. Returns the reference and placement that were used, or nullopt if the map was
  // coded alone.
  std::optional<Reference> CodeBehind(std::size_t maps_back, const CodedLayers& source);
  void Code(const std::optional<Reference>& reference, const CodedLayers& source, RangeEncoder& coder, BitModel& model);
  bool CodeCheaper(const Reference& reference, const CodedLayers& source);

  Previous previous_;
  PreviousTrials trials_;
  std::vector<std::uint32_t> sources_;  // Sources of the earlier maps, except the reference, which has no source.
  RangeEncoder coder_;
};

class MapRunDecoder : public MapRun {
 public:
  explicit MapRunDecoder(const std::vector<MapLayer>* reference = nullptr) : MapRun(reference) {}

  // Fills the cells of the next maps of the run. Requires: the layers have the same sizes and resolutions as at the
  // encoder. Returns kCorrupt if sizes exceed the limits, a map refers to a map that is not in the run, a checksum does
  // not match, or bytes follow the last map. After an error the run has ended and every further call fails.
  Result<void> Decode(std::string_view coded, std::vector<std::vector<MapLayer>*>& maps);

 private:
  Result<void> DecodeMap(RangeDecoder& coder, std::vector<MapLayer>& layers);

  bool has_failed_ = false;
};

}  // namespace moondb
