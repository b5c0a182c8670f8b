// Merger: turns a MapPlacement into one merged map of three values, and says for each cell where its value came from.
//
// Two backends with the same bytes: GL through EGL without a window (OpenGL ES 3.1; paper, Section 5.3) and CPU. All
// state that lasts lies with the caller (MapCollection), so that a lost context costs one merge.
// A merger is used by one thread at a time.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "actors/merge/placement.h"
#include "model/error.h"
#include "model/traversability_map.h"

namespace moondb {

// Levels are layers of the winning map, 0 the finest.
inline constexpr std::uint8_t kFootprintLevel = 255;

struct MergeResult {
  MergedMap merged;
  // Row by row like merged.grid.cells. An unknown cell has kNoSlot and level 0, a footprint kNoSlot and
  // kFootprintLevel; others name MapPlacement::slots.
  std::vector<std::uint16_t> slots;
  std::vector<std::uint8_t> levels;

  bool operator==(const MergeResult& other) const;
};

// Polled during a merge; true ends it early.
using StopPredicate = std::function<bool()>;

class Merger {
 public:
  virtual ~Merger() = default;

  // Errors: kUnavailable for a lost GL context, for memory that the driver does not give, or when `stop` said so;
  // kFull for more cells than the driver's textures hold.
  virtual Result<MergeResult> Merge(const MapPlacement& placement, const StopPredicate& stop) = 0;
  Result<MergeResult> Merge(const MapPlacement& placement) { return Merge(placement, {}); }

  virtual std::string name() const = 0;         // "cpu" or "gl".
  virtual std::string description() const = 0;  // With the driver: "gl (llvmpipe (LLVM 15.0.6, 256 bits))".
};

enum class MergeBackend {
  kAuto,  // GL on a real GPU; CPU where there is none or it is drawn by software (llvmpipe, softpipe).
  kCpu,
  kGl,  // Also by software; an error where there is no driver.
};

// "auto", "cpu", "gl".
std::string ToString(MergeBackend backend);
Result<MergeBackend> ParseMergeBackend(std::string_view text);  // kInvalid otherwise.

// What kAuto means on this machine: kCpu or kGl. The others stay as they are. Opens a driver and closes it.
MergeBackend ResolveMergeBackend(MergeBackend backend);

// kUnavailable for kGl without a working OpenGL ES 3.1 driver; kAuto and kCpu do not fail.
Result<std::unique_ptr<Merger>> CreateMerger(MergeBackend backend);

// An unknown grid of the placement's extent, with its provenance.
MergeResult MakeEmptyResult(const MapPlacement& placement);

}  // namespace moondb
