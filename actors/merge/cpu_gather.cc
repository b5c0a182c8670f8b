#include "actors/merge/cpu_gather.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <optional>

namespace moondb {
namespace {

const GatherKernel& BestKernel() {
  static const GatherKernel& best = *AvailableKernels().back();
  return best;
}

// Coarse bitmap of a footprint. All bits are set, because a footprint knows all its cells.
constexpr int kAllBitsShift = 3;
constexpr auto kAllBits = [] {
  std::array<std::uint64_t, (kBlockSideCellsMax >> kAllBitsShift) + 1> rows{};
  for (std::uint64_t& row : rows) row = ~std::uint64_t{0};
  return rows;
}();

KernelBlock SeenFrom(const PlacedBlock& block, const CellBox& tile) {
  const PlacedRectangle& placed = block.rectangle;
  const std::int64_t i = tile.first_x - placed.anchor_x;
  const std::int64_t j = tile.first_y - placed.anchor_y;
  KernelBlock seen{};
  if (block.is_footprint()) {
    seen.coarse_rows = kAllBits.data();
    seen.coarse_shift = kAllBitsShift;
  } else {
    seen.coarse_rows = block.cells->coarse_rows();
    seen.coarse_shift = block.cells->coarse_shift();
    seen.words = block.cells->words();
    seen.strip_words = block.cells->strip_words();
    seen.strip_count = block.cells->strip_count();
  }
  seen.u = placed.u0 + i * placed.step_cos + j * placed.step_sin;
  seen.v = placed.v0 - i * placed.step_sin + j * placed.step_cos;
  seen.step_cos = placed.step_cos;
  seen.step_sin = placed.step_sin;
  seen.width_q = placed.width_q;
  seen.height_q = placed.height_q;
  return seen;
}

KernelTile ArraysOf(Tile& tile) {
  return {tile.known.data(), tile.hazard.data(), tile.weakest.data(), tile.winners.data()};
}

// Working state of one thread of the pool.
class Gatherer {
 public:
  Gatherer(const GatherKernel& kernel, std::span<const OrderedBlock> blocks) : kernel_(kernel), lister_(blocks) {}

  void GatherPage(GatherWork& work) {
    lister_.List(work.key, list_);
    for (std::size_t tile = 0; tile < kTilesInPage; ++tile) {
      if ((work.tiles >> tile & 1) == 0) continue;
      if (GatherTile(BoxOf(work.key, tile), work.page->tiles[tile])) {
        work.changed = static_cast<std::uint16_t>(work.changed | 1 << tile);
      }
    }
  }

 private:
  // Gathers one tile. Returns true if the value of at least one cell changed.
  bool GatherTile(const CellBox& box, std::unique_ptr<Tile>& tile) {
    std::optional<Masks> before;
    if (tile != nullptr) before = Masks{tile->known, tile->hazard};
    std::unique_ptr<Tile> gathered = std::move(tile);
    std::uint64_t open = ~std::uint64_t{0};
    bool is_started = false;
    for (const OrderedBlock& ordered : list_) {
      if (!ordered.box.Touches(box)) continue;
      if (!is_started) {
        if (gathered == nullptr) gathered = std::make_unique_for_overwrite<Tile>();
        gathered->known.fill(0);
        gathered->hazard.fill(0);
        gathered->blocks.clear();
        is_started = true;
      }
      // 16 bits suffice: each winner has at least one of the tile's 4096 cells.
      const auto winner = static_cast<std::uint16_t>(gathered->blocks.size());
      const KernelResult result = kernel_.gather(SeenFrom(*ordered.block, box), ArraysOf(*gathered), open, winner);
      if (result.has_won) gathered->blocks.push_back(ordered.block);
      open = result.open;
      if (open == 0) break;
    }
    const bool is_known = is_started && !gathered->blocks.empty();
    if (!is_known) return before.has_value();
    tile = std::move(gathered);
    return !before || before->known != tile->known || before->hazard != tile->hazard;
  }

  struct Masks {
    std::array<std::uint64_t, kSquaresInTile> known;
    std::array<std::uint64_t, kSquaresInTile> hazard;
  };

  const GatherKernel& kernel_;
  PageLister lister_;
  std::vector<OrderedBlock> list_;  // Blocks of the current page.
};

}  // namespace

std::vector<const GatherKernel*> AvailableKernels() {
  std::vector<const GatherKernel*> kernels = {ScalarKernel()};
  // Check the processor first: merely calling Avx2Kernel() or Avx512Kernel() may execute AVX2 or AVX-512 instructions.
  [[maybe_unused]] const auto add = [&kernels](const GatherKernel* kernel) {
    if (kernel != nullptr) kernels.push_back(kernel);
  };
#if defined(__x86_64__)
  add(Sse2Kernel());
  if (__builtin_cpu_supports("avx2") != 0) add(Avx2Kernel());
  const bool has_avx512 = __builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512bw") != 0 &&
                          __builtin_cpu_supports("avx512vbmi") != 0;
  if (has_avx512) add(Avx512Kernel());
#endif
  return kernels;
}

bool WouldWinIn(const PlacedBlock& block, const CellBox& box, const Tile* tile) {
  if (tile == nullptr) {
    constexpr std::array<std::uint64_t, kSquaresInTile> kNothing{};
    return BestKernel().would_win(SeenFrom(block, box), kNothing.data(), 0);
  }
  std::vector<bool> is_weaker(tile->blocks.size());
  bool is_any_weaker = false;
  for (std::size_t i = 0; i < is_weaker.size(); ++i) {
    is_weaker[i] = tile->blocks[i]->rank > block.rank;
    is_any_weaker = is_any_weaker || is_weaker[i];
  }
  std::uint64_t weaker = 0;
  bool is_open = false;
  for (std::size_t square = 0; square < kSquaresInTile; ++square) {
    is_open = is_open || ~tile->known[square] != 0;
    if (tile->known[square] == 0 || !is_any_weaker) continue;
    weaker |= static_cast<std::uint64_t>(is_weaker[tile->weakest[square]]) << square;
  }
  if (!is_open && weaker == 0) return false;
  return BestKernel().would_win(SeenFrom(block, box), tile->known.data(), weaker);
}

std::uint64_t SquaresThatMayKnow(const PlacedBlock& block, const CellBox& box) {
  return BestKernel().may_know(SeenFrom(block, box));
}

void PageLister::List(const PageKey& page, std::vector<OrderedBlock>& list) {
  ListRegion(page);
  list.clear();
  const CellBox box = BoxOf(page);
  for (const OrderedBlock& ordered : region_list_) {
    if (ordered.box.Touches(box)) list.push_back(ordered);
  }
}

// Lists the blocks that touch the region of 8 x 8 pages that contains `page`. For every page of this region, List()
// then searches only these blocks.
void PageLister::ListRegion(const PageKey& page) {
  constexpr std::int32_t kBits = 3;
  const PageKey region{page.x >> kBits, page.y >> kBits};
  if (region_ == region) return;
  region_ = region;
  CellBox box = BoxOf({region.x * (1 << kBits), region.y * (1 << kBits)});
  box.last_x += kPageSideCells * ((1 << kBits) - 1);
  box.last_y += kPageSideCells * ((1 << kBits) - 1);
  region_list_.clear();
  for (const OrderedBlock& ordered : all_) {
    if (ordered.box.Touches(box)) region_list_.push_back(ordered);
  }
}

CpuGather::CpuGather(Options options)
    : kernel_(options.kernel != nullptr ? options.kernel : &BestKernel()), pool_(std::clamp(options.threads, 1, 64)) {}

std::string CpuGather::description() const {
  return "cpu (" + std::string(kernel_->name) + ", " + std::to_string(pool_.thread_count()) +
         (pool_.thread_count() == 1 ? " thread)" : " threads)");
}

Result<void> CpuGather::Gather(std::span<const OrderedBlock> blocks, std::span<GatherWork> works,
                               const StopPredicate& stop) {
  std::atomic<std::size_t> next{0};
  std::atomic<bool> is_stopped{false};
  const auto gather = [&](int worker) {
    Gatherer gatherer(*kernel_, blocks);
    while (!is_stopped) {
      if (worker == 0 && stop && stop()) is_stopped = true;
      const std::size_t index = is_stopped ? works.size() : next++;
      if (index >= works.size()) return;
      gatherer.GatherPage(works[index]);
    }
  };
  if (works.size() == 1) {
    gather(0);
  } else if (!works.empty()) {
    pool_.Run(gather);
  }
  if (is_stopped) return Fail(ErrorCode::kUnavailable, "the merge was stopped");
  return {};
}

}  // namespace moondb
