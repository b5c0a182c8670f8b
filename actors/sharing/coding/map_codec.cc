#include "actors/sharing/coding/map_codec.h"

#include <xxhash.h>

#include <algorithm>
#include <utility>

#include "actors/sharing/coding/layer_coder.h"
#include "actors/sharing/coding/trained_tables.h"
#include "model/check.h"

namespace moondb {

namespace {

constexpr int kEven = kProbabilityOne / 2;
constexpr int kMapsBackBits = 5;
constexpr int kChecksumBits = 16;
constexpr std::uint32_t kDepthMax = 3;

template <typename Coder>
std::uint32_t CodeBits(Coder& coder, std::uint32_t value, int count) {
  std::uint32_t coded = 0;
  for (int i = count - 1; i >= 0; --i)
    coded = coded << 1 | static_cast<std::uint32_t>(coder.Code(value >> i & 1, kEven));
  return coded;
}

template <typename Coder>
std::int32_t CodeSigned(Coder& coder, std::int32_t value, int count) {
  const std::int32_t offset = 1 << (count - 1);
  return static_cast<std::int32_t>(CodeBits(coder, static_cast<std::uint32_t>(value + offset), count)) - offset;
}

template <typename Coder>
MapPlacement CodePlacement(Coder& coder, const MapPlacement& placement) {
  MapPlacement coded;
  coded.x = CodeSigned(coder, placement.x, kPlacementBits);
  coded.y = CodeSigned(coder, placement.y, kPlacementBits);
  coded.yaw = static_cast<std::int32_t>(CodeBits(coder, static_cast<std::uint32_t>(placement.yaw), kTurnBits));
  return coded;
}

std::uint64_t CellCount(const CodedLayers& layers) {
  std::uint64_t count = 0;
  for (const CodedLayer& layer : layers)
    count += static_cast<std::uint64_t>(layer.cells.width()) * layer.cells.height();
  return count;
}

CodedLayers Unknown(const std::vector<MapLayer>& layers) {
  CodedLayers coded;
  for (const MapLayer& layer : layers) {
    coded.push_back({CellPlane(layer.grid.width, layer.grid.height), layer.resolution_um, {}});
  }
  return coded;
}

CodedLayers ToCoded(const std::vector<MapLayer>& layers) {
  CodedLayers coded = Unknown(layers);
  for (std::size_t i = 0; i < layers.size(); ++i) {
    const Grid& grid = layers[i].grid;
    for (std::int32_t row = 0; row < grid.height; ++row) {
      std::uint8_t* cells = coded[i].cells.At(0, row);
      for (std::int32_t column = 0; column < grid.width; ++column) {
        cells[column] = static_cast<std::uint8_t>(grid.At(column, row));
      }
    }
  }
  return coded;
}

Grid ToGrid(const CellPlane& plane) {
  Grid grid(plane.width(), plane.height());
  for (std::int32_t row = 0; row < grid.height; ++row) {
    const std::uint8_t* cells = plane.At(0, row);
    for (std::int32_t column = 0; column < grid.width; ++column)
      grid.At(column, row) = static_cast<Cell>(cells[column]);
  }
  return grid;
}

std::uint32_t Checksum(const CodedLayers& layers) {
  std::uint64_t hash = 0;
  for (const CodedLayer& layer : layers) {
    for (std::int32_t row = 0; row < layer.cells.height(); ++row) {
      hash = XXH64(layer.cells.At(0, row), static_cast<std::size_t>(layer.cells.width()), hash);
    }
  }
  return static_cast<std::uint32_t>(hash & ((1u << kChecksumBits) - 1));
}

CoarserIndex MakeCoarserIndex(std::int32_t side, std::int64_t resolution, std::int32_t coarser_side,
                              std::int64_t coarser_resolution) {
  CoarserIndex index;
  for (std::int32_t i = 0; i < side; ++i) {
    // The position of the cell's middle, measured from the coarser layer's edge, in half micrometres.
    const std::int64_t place = (2 * i + 1 - side) * resolution + coarser_side * coarser_resolution;
    const bool is_inside = place >= 0 && place < 2 * coarser_side * coarser_resolution;
    index.index.push_back(is_inside ? static_cast<std::int32_t>(place / (2 * coarser_resolution)) : -1);
    index.half.push_back(is_inside && place % (2 * coarser_resolution) >= coarser_resolution ? 1 : 0);
  }
  return index;
}

// The position of a layer's columns and rows on the next coarser layer.
struct CoarserIndices {
  CoarserIndex columns;
  CoarserIndex rows;
};

CoarserIndices MakeCoarserIndices(const CodedLayer& layer, const CodedLayer& coarser) {
  return {MakeCoarserIndex(layer.cells.width(), layer.resolution_um, coarser.cells.width(), coarser.resolution_um),
          MakeCoarserIndex(layer.cells.height(), layer.resolution_um, coarser.cells.height(), coarser.resolution_um)};
}

bool AreHazardsNested(const CodedLayer& layer, const CodedLayer& coarser, const CoarserIndices& indices) {
  for (std::int32_t row = 0; row < layer.cells.height(); ++row) {
    const std::int32_t y = indices.rows.index[static_cast<std::size_t>(row)];
    for (std::int32_t column = 0; column < layer.cells.width(); ++column) {
      if (*layer.cells.At(column, row) != static_cast<std::uint8_t>(Cell::kHazard)) continue;
      const std::int32_t x = indices.columns.index[static_cast<std::size_t>(column)];
      if (x >= 0 && y >= 0 && *coarser.cells.At(x, y) != static_cast<std::uint8_t>(Cell::kHazard)) return false;
    }
  }
  return true;
}

}  // namespace

std::uint64_t CellCountOf(const std::vector<MapLayer>& layers) {
  std::uint64_t count = 0;
  for (const MapLayer& layer : layers) {
    count += static_cast<std::uint64_t>(layer.grid.width) * static_cast<std::uint64_t>(layer.grid.height);
  }
  return count;
}

bool IsCodable(const std::vector<MapLayer>& layers) {
  if (layers.empty() || layers.size() > static_cast<std::size_t>(kMapLayersMax)) return false;
  for (const MapLayer& layer : layers) {
    const Grid& grid = layer.grid;
    if (grid.width < 1 || grid.height < 1 || grid.width > kCodedMapSideMax || grid.height > kCodedMapSideMax)
      return false;
    if (layer.resolution_um < 1 || layer.resolution_um > kMapResolutionUmMax) return false;
  }
  return CellCountOf(layers) <= kCodedMapCellsMax;
}

MapRun::MapRun(const std::vector<MapLayer>* reference) : model_(TrainedModel()) {
  if (!reference) return;
  Check(IsCodable(*reference), "a reference is a map that can be coded");
  Keep(std::nullopt, ToCoded(*reference));
}

void MapRun::MakeRoomFor(const CodedLayers& layers) {
  if (earlier_.size() < kRunMapsMax && earlier_cells_ + CellCount(layers) <= kRunCellsMax) return;
  earlier_.clear();
  earlier_cells_ = 0;
  model_ = TrainedModel();
}

void MapRun::Keep(const std::optional<Reference>& reference, CodedLayers layers) {
  for (CodedLayer& layer : layers) {
    layer.memory = reference ? Place(EarlierOf(*reference), layer, layers.front().resolution_um, reference->placement)
                             : CellPlane(layer.cells.width(), layer.cells.height());
    for (std::int32_t row = 0; row < layer.cells.height(); ++row) {
      const std::uint8_t* cells = layer.cells.At(0, row);
      CellMemory* memory = layer.memory.At(0, row);
      for (std::int32_t column = 0; column < layer.cells.width(); ++column) {
        memory[column] = Remember(reference ? memory[column] : kNoMemory, cells[column]);
      }
    }
  }
  earlier_cells_ += CellCount(layers);
  earlier_.push_back(std::make_shared<const CodedLayers>(std::move(layers)));
}

template <typename Coder>
void MapRun::CodeCells(const std::optional<Reference>& reference, const CodedLayers& source, Coder& coder,
                       BitModel& model, CodedLayers& cells) {
  const CodedLayers* earlier = reference ? &EarlierOf(*reference) : nullptr;
  CellPlane coarser_previous;
  for (std::size_t i = cells.size(); i-- > 0;) {
    CodedLayer& layer = cells[i];
    LayerContext context;
    context.depth = std::min<std::uint32_t>(static_cast<std::uint32_t>(i), kDepthMax);
    CoarserIndices indices;
    if (i + 1 < cells.size()) {
      const CodedLayer& coarser = cells[i + 1];
      indices = MakeCoarserIndices(layer, coarser);
      context.coarser = &coarser.cells;
      context.columns = &indices.columns;
      context.rows = &indices.rows;
      const bool are_nested = Coder::kIsEncoder && AreHazardsNested(source[i], coarser, indices);
      context.are_hazards_nested = coder.Code(are_nested ? 1 : 0, kEven) != 0;
    }
    CellPlane previous;
    if (earlier) {
      previous = Place(*earlier, layer, cells.front().resolution_um, reference->placement);
      context.previous = &previous;
      context.coarser_previous = &coarser_previous;
    }
    if (!rays_.IsFor(layer.cells.width(), layer.cells.height())) {
      rays_ = RayTable(layer.cells.width(), layer.cells.height());
    }
    CodeLayer(context, rays_, source[i].cells, coder, model, layer.cells);
    coarser_previous = std::move(previous);
  }
}

MapRunEncoder::MapRunEncoder(Previous previous, const std::vector<MapLayer>* reference, const PreviousTrials& trials)
    : MapRun(reference), previous_(previous), trials_(trials) {}

void MapRunEncoder::Add(const std::vector<MapLayer>& layers, std::uint32_t source) {
  Check(IsCodable(layers), "a map that can be coded");
  CodedLayers coded = ToCoded(layers);
  MakeRoomFor(coded);
  if (earlier_.empty()) sources_.clear();
  std::optional<Reference> reference;
  if (const std::optional<std::size_t> maps_back = MapsBackTo(source)) {
    reference = CodeBehind(*maps_back, coded);
  } else {
    Code(std::nullopt, coded, coder_, model_);
  }
  CodeBits(coder_, Checksum(coded), kChecksumBits);
  Keep(reference, std::move(coded));
  sources_.push_back(source);
}

PreviousTrials::Way MapRunEncoder::WayOfNext() const {
  switch (previous_) {
    case Previous::kNever:
      return PreviousTrials::Way::kAlone;
    case Previous::kWhereItPays:
      return PreviousTrials::Way::kBoth;
    case Previous::kWhileItPays:
      return trials_.next();
    case Previous::kWherePlaced:
      return PreviousTrials::Way::kWithPrevious;
  }
  return PreviousTrials::Way::kAlone;
}

std::optional<std::size_t> MapRunEncoder::MapsBackTo(std::uint32_t source) const {
  const auto newest = std::find(sources_.rbegin(), sources_.rend(), source);
  // If no map has this source, `newest` is rend(), and maps_back leads to the reference, if there is one.
  const std::size_t maps_back = static_cast<std::size_t>(newest - sources_.rbegin()) + 1;
  if (maps_back > earlier_.size()) return std::nullopt;
  return maps_back;
}

std::optional<MapRun::Reference> MapRunEncoder::CodeBehind(std::size_t maps_back, const CodedLayers& source) {
  const PreviousTrials::Way way = WayOfNext();
  std::optional<MapPlacement> placement;
  if (way != PreviousTrials::Way::kAlone) placement = FindPlacement(*earlier_[earlier_.size() - maps_back], source);
  std::optional<Reference> reference;
  if (placement) reference = Reference{maps_back, *placement};
  if (!reference || way == PreviousTrials::Way::kWithPrevious) {
    Code(reference, source, coder_, model_);
    trials_.Coded(way, reference.has_value());
  } else if (!CodeCheaper(*reference, source)) {
    reference.reset();
  }
  return reference;
}

// Codes the map with and without the reference and keeps the smaller result. Returns true if the reference was used.
bool MapRunEncoder::CodeCheaper(const Reference& reference, const CodedLayers& source) {
  const std::size_t bytes_before = coder_.byte_count();
  RangeEncoder coder_alone = coder_;
  BitModel model_alone = model_;
  Code(reference, source, coder_, model_);
  Code(std::nullopt, source, coder_alone, model_alone);
  trials_.Compared(coder_alone.byte_count() - bytes_before, coder_.byte_count() - bytes_before);
  if (coder_alone.byte_count() > coder_.byte_count()) return true;
  coder_ = std::move(coder_alone);
  model_ = std::move(model_alone);
  return false;
}

void MapRunEncoder::Code(const std::optional<Reference>& reference, const CodedLayers& source, RangeEncoder& coder,
                         BitModel& model) {
  coder.Code(reference ? 1 : 0, kEven);
  if (reference) {
    CodeBits(coder, static_cast<std::uint32_t>(reference->maps_back - 1), kMapsBackBits);
    CodePlacement(coder, reference->placement);
  }
  CodedLayers cells;
  for (const CodedLayer& layer : source) {
    cells.push_back({CellPlane(layer.cells.width(), layer.cells.height()), layer.resolution_um, {}});
  }
  CodeCells(reference, source, coder, model, cells);
}

Result<void> MapRunDecoder::Decode(std::string_view coded, std::vector<std::vector<MapLayer>*>& maps) {
  if (has_failed_) return Fail(ErrorCode::kCorrupt, "depends on earlier maps that did not decode", "map");
  has_failed_ = true;
  std::uint64_t cell_count = 0;
  for (const std::vector<MapLayer>* layers : maps) {
    if (!IsCodable(*layers)) return Fail(ErrorCode::kCorrupt, "is larger than a coded map may be", "map");
    cell_count += CellCountOf(*layers);
  }
  if (cell_count > kCodedCellsMax) return Fail(ErrorCode::kCorrupt, "has more cells than may be coded at once", "map");
  RangeDecoder coder(coded);
  for (std::vector<MapLayer>* layers : maps) {
    const Result<void> done = DecodeMap(coder, *layers);
    if (!done) return done;
  }
  if (!coder.IsAtEnd()) return Fail(ErrorCode::kCorrupt, "has bytes after its end", "map");
  has_failed_ = false;
  return {};
}

Result<void> MapRunDecoder::DecodeMap(RangeDecoder& coder, std::vector<MapLayer>& layers) {
  CodedLayers cells = Unknown(layers);
  MakeRoomFor(cells);
  std::optional<Reference> reference;
  if (coder.Code(0, kEven) != 0) {
    reference.emplace();
    reference->maps_back = CodeBits(coder, 0, kMapsBackBits) + 1;
    if (reference->maps_back > earlier_.size())
      return Fail(ErrorCode::kCorrupt, "refers to a map that is missing here", "map");
    reference->placement = CodePlacement(coder, {});
  }
  CodeCells(reference, cells, coder, model_, cells);
  if (CodeBits(coder, 0, kChecksumBits) != Checksum(cells)) {
    return Fail(ErrorCode::kCorrupt, "does not match its checksum", "map");
  }
  for (std::size_t i = 0; i < layers.size(); ++i) layers[i].grid = ToGrid(cells[i].cells);
  Keep(reference, std::move(cells));
  return {};
}

}  // namespace moondb
