// GatherBackend: fills tiles of the merged map: for each cell the first known value among the blocks that cover it, the
// greatest key first.
//
// Two ways with the same bytes, values and winners: on the CPU, and on a GPU through OpenGL ES 3.1 without a window
// (paper, Section 5.3). A backend keeps nothing that cannot be made anew from the blocks, so that a lost context costs
// one merge. Used by one thread at a time; several mergers may share one.
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

// A page of which some tiles are gathered.
struct GatherWork {
  PageKey key;
  Page* page = nullptr;
  std::uint16_t tiles = 0;    // A bit each.
  std::uint16_t changed = 0;  // Added to: those in which a cell has another value than before.
};

// A block and its box, for a fast look.
struct OrderedBlock {
  CellBox box;
  PlacedBlock* block = nullptr;
};

// Polled during a merge, on its thread; true ends it early.
using StopPredicate = std::function<bool()>;

class GatherBackend {
 public:
  virtual ~GatherBackend() = default;

  // `blocks` with the greatest key first. On an error some tiles are gathered and some are not; all are whole. Errors:
  // kUnavailable for a lost GL context, for memory that the driver does not give, or when `stop` said so; kFull for
  // more than the driver's textures hold.
  virtual Result<void> Gather(std::span<const OrderedBlock> blocks, std::span<GatherWork> works,
                              const StopPredicate& stop) = 0;

  virtual std::string name() const = 0;         // "cpu" or "gl": who gathers now.
  virtual std::string description() const = 0;  // With the driver or the instructions: "gl (llvmpipe ...)".
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

// `threads` as in CpuGather. With GL the CPU stands behind it: when the context is lost, the CPU goes on at once, and
// GL is tried again later. kUnavailable for kGl without a working OpenGL ES 3.1 driver; kAuto and kCpu do not fail.
Result<std::unique_ptr<GatherBackend>> CreateGatherBackend(MergeBackend backend, int threads = 1);

}  // namespace moondb
