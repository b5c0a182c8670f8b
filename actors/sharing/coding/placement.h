// MapPlacement: the pose of a later map relative to an earlier map. Place resamples the earlier map's memory to the
// later map's grid.
//
// The encoder searches for the placement (FindPlacement) and sends it; the decoder only applies it. Placing uses
// integers, so encoder and decoder get the same result. The search may change without a change of the wire format.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "actors/sharing/coding/cell_memory.h"
#include "actors/sharing/coding/cell_plane.h"

namespace moondb {

// One layer of a map in the codec's representation. CodedLayers are a map's layers, finest first.
struct CodedLayer {
  CellPlane cells;  // Values of moondb::Cell.
  std::uint32_t resolution_um = 1;
  CellPlane memory;  // Values of CellMemory; set only for earlier maps of a run.
};
using CodedLayers = std::vector<CodedLayer>;

inline constexpr int kPlacementBits = 12;  // Bits of x and of y, including the sign.
inline constexpr int kTurnBits = 10;
inline constexpr std::int32_t kTurn = 1 << kTurnBits;

// The transform earlier_from_later. x and y are in half cells of the later map's finest layer, from -2048 to 2047. yaw
// is in 1/1024 turn, from 0 to 1023.
struct MapPlacement {
  std::int32_t x = 0;
  std::int32_t y = 0;
  std::int32_t yaw = 0;
  bool operator==(const MapPlacement&) const = default;
};

// Cosine and sine of a yaw angle, in units of 1/16384.
struct Rotation {
  std::int64_t cosine = 0;
  std::int64_t sine = 0;
};
inline constexpr int kRotationBits = 14;
Rotation RotationOf(std::int32_t yaw);

// Returns the earlier map's memory at the middles of the later layer's cells. The memory of each cell comes from the
// finest earlier layer that covers the cell and is not finer than the later layer. A cell that no such layer covers
// gets kNoMemory. `unit_um` is the resolution of the later map's finest layer.
CellPlane Place(const CodedLayers& earlier, const CodedLayer& later, std::uint32_t unit_um,
                const MapPlacement& placement);

// Returns the placement at which the hazards of both maps match best, for any yaw and a shift of a few cells of the
// coarsest layer. Nullopt if there are too few hazards or no placement matches. Takes about 3 ms for four layers of 100
// x 100 cells.
std::optional<MapPlacement> FindPlacement(const CodedLayers& earlier, const CodedLayers& later);

}  // namespace moondb
