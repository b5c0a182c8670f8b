// CpuGather: gathers on a pool of CPU threads, with the best instruction set that this processor has.
//
// For each page, CpuGather lists the blocks that touch the page. For each tile of the page, it applies the listed
// blocks that touch the tile, by descending key, until all cells are known. The result does not depend on the number of
// threads.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "actors/merge/gather_backend.h"
#include "actors/merge/gather_kernel.h"
#include "actors/merge/gather_pool.h"

namespace moondb {

// Returns the kernels that this processor can run, the best one last: "scalar", "sse2", "avx2", "avx512".
std::vector<const GatherKernel*> AvailableKernels();

// Returns true if `block` may win a cell of the tile at `box`, and false if it certainly wins none. `tile`: the merged
// tile; null if the tile has no known cell.
bool WouldWinIn(const PlacedBlock& block, const CellBox& box, const Tile* tile);

// Returns the squares of the tile at `box`, one bit each, in which `block` may have a known cell.
std::uint64_t SquaresThatMayKnow(const PlacedBlock& block, const CellBox& box);

// Lists the blocks that touch a page, in priority order. Consecutive requests for neighbouring pages are fastest.
class PageLister {
 public:
  explicit PageLister(std::span<const OrderedBlock> blocks) : all_(blocks) {}
  void List(const PageKey& page, std::vector<OrderedBlock>& list);

 private:
  void ListRegion(const PageKey& page);

  const std::span<const OrderedBlock> all_;
  std::optional<PageKey> region_;
  std::vector<OrderedBlock> region_list_;
};

class CpuGather final : public GatherBackend {
 public:
  struct Options {
    int threads = 1;                       // Number of threads, 1 to 64. For all processors: HardwareThreads().
    const GatherKernel* kernel = nullptr;  // Null selects the best kernel.
  };

  explicit CpuGather(Options options);

  Result<void> Gather(std::span<const OrderedBlock> blocks, std::span<GatherWork> works,
                      const StopPredicate& stop) override;
  std::string name() const override { return "cpu"; }
  std::string description() const override;

 private:
  const GatherKernel* const kernel_;
  GatherPool pool_;
};

}  // namespace moondb
