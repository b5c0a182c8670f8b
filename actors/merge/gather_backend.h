// GatherBackend: fills tiles of the merged map. Each cell gets its value from the block with the greatest key
// (actors/merge/placement.h) among the blocks that know the cell.
//
// There are two implementations, one on the CPU and one with OpenGL ES 3.1 (paper, Section 5.3). Their values and
// winners are identical, byte for byte. A backend holds no state that it cannot rebuild from the blocks. Used by one
// thread at a time; several mergers may share one backend.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "actors/merge/placement.h"
#include "actors/merge/tile.h"
#include "model/error.h"

namespace moondb {

// A page and its tiles to gather.
struct GatherWork {
  PageKey key;
  Page* page = nullptr;
  std::uint16_t tiles = 0;  // Tiles to gather, one bit each.
  // Tiles in which the value of a cell changed, one bit each. Gather sets bits and never clears them.
  std::uint16_t changed = 0;
};

// A block and a copy of its box, for fast access.
struct OrderedBlock {
  CellBox box;
  PlacedBlock* block = nullptr;
};

// Called repeatedly by the merging thread during a merge. Returns true to end the merge early.
using StopPredicate = std::function<bool()>;

class GatherBackend {
 public:
  virtual ~GatherBackend() = default;

  // Fills the tiles of `works`. Requires: `blocks` are sorted by descending key. After an error, each tile is either
  // completely gathered or unchanged. Returns kUnavailable if the GL context is lost, the driver is out of memory, or
  // `stop` returned true. Returns kFull if the driver's textures are too small.
  virtual Result<void> Gather(std::span<const OrderedBlock> blocks, std::span<GatherWork> works,
                              const StopPredicate& stop) = 0;

  virtual std::string name() const = 0;  // Name of the implementation currently in use: "cpu" or "gl".
  // Name with the driver or instruction set, for example "gl (llvmpipe ...)".
  virtual std::string description() const = 0;
};

enum class MergeBackend {
  kAuto,  // GL on a real GPU; CPU if there is no GPU or GL is a software renderer (llvmpipe, softpipe).
  kCpu,
  kGl,  // GL, even on a software renderer; an error if there is no driver.
};

// Returns "auto", "cpu" or "gl".
std::string ToString(MergeBackend backend);
// Parses a result of ToString. Returns kInvalid for any other text.
Result<MergeBackend> ParseMergeBackend(std::string_view text);

// Replaces kAuto by kGl or kCpu, depending on the drivers of this machine. Returns any other value unchanged.
MergeBackend ResolveMergeBackend(MergeBackend backend);

// Creates a backend. `threads`: number of CPU threads, as in CpuGather::Options. If a GL backend loses its context, the
// CPU continues immediately and GL is tried again later. Returns kUnavailable for kGl without a working OpenGL ES 3.1
// driver. kAuto and kCpu never fail.
Result<std::unique_ptr<GatherBackend>> CreateGatherBackend(MergeBackend backend, int threads = 1);

}  // namespace moondb
