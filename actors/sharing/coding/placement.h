// MapPlacement: where one map lies in an earlier one, and what is remembered there on the later one's grid.
//
// The encoder looks for it (FindPlacement) and sends it; the decoder only applies it. All of it is in whole numbers, so
// that both ends place alike; the search may change without changing the format.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "actors/sharing/coding/cell_memory.h"
#include "actors/sharing/coding/cell_plane.h"

namespace moondb {

// A map's layers, finest first, as the codec works on them.
struct CodedLayer {
  CellPlane cells;  // As moondb::Cell.
  std::uint32_t resolution_um = 1;
  CellPlane memory;  // As CellMemory; of earlier maps.
};
using CodedLayers = std::vector<CodedLayer>;

inline constexpr int kPlacementBits = 12;  // Of x and of y, with the sign.
inline constexpr int kTurnBits = 10;
inline constexpr std::int32_t kTurn = 1 << kTurnBits;

// earlier_from_later. x and y in half cells of the later map's finest layer, -2048 to 2047; yaw in 1/1024 turn, 0 to
// 1023.
struct MapPlacement {
  std::int32_t x = 0;
  std::int32_t y = 0;
  std::int32_t yaw = 0;
  bool operator==(const MapPlacement&) const = default;
};

// Cosine and sine of a yaw, in 1/16384.
struct Rotation {
  std::int64_t cosine = 0;
  std::int64_t sine = 0;
};
inline constexpr int kRotationBits = 14;
Rotation RotationOf(std::int32_t yaw);

// The earlier map's memory under the middles of a later layer's cells, from its finest layer that is not finer than
// this one; kNoMemory where none reaches. `unit_um` is the resolution of the later map's finest layer.
CellPlane Place(const CodedLayers& earlier, const CodedLayer& later, std::uint32_t unit_um,
                const MapPlacement& placement);

// The placement at which hazards best lie on hazards, within some cells of the coarsest layer and any turn; none where
// there is nothing to go by. Takes some 3 ms for four layers of 100 x 100.
std::optional<MapPlacement> FindPlacement(const CodedLayers& earlier, const CodedLayers& later);

}  // namespace moondb
