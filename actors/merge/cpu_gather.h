// CpuGather: the gather on the CPU, with the best instructions that this processor has, on a pool of threads.
//
// Per page a list of the blocks that touch it, per tile those of the list that touch the tile, in order, until all
// cells are known. Tiles are independent of each other, so that the number of threads changes nothing in the result.
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

// Those that this processor can run, the best one last: "scalar", "sse2", "avx2", "avx512".
std::vector<const GatherKernel*> AvailableKernels();

// Whether `block` knows a cell of the tile at `box` that is unknown there or won by a block of lower rank.
bool WouldWinIn(const PlacedBlock& block, const CellBox& box, const Tile* tile);

// The squares of the tile at `box`, a bit each, of which `block` may know something.
std::uint64_t SquaresThatMayKnow(const PlacedBlock& block, const CellBox& box);

// The blocks that touch a page, in order; asked for page after page, neighbours next to each other.
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
    int threads = 1;                       // How many work at once, 1 to 64; HardwareThreads() for all there are.
    const GatherKernel* kernel = nullptr;  // Null: the best.
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
