// Scalar kernel, for any processor.
#include "actors/merge/gather_loop.h"

namespace moondb {
namespace {

class ScalarView {
 public:
  explicit ScalarView(const KernelBlock& block, const SquareReach&) : block_(block) {}
  static std::uint64_t Touched(const KernelBlock& block, const SquareReach& reach) {
    return TouchedOneByOne(block, reach);
  }
  Seen See(std::int64_t u, std::int64_t v, std::uint64_t wanted) const { return ObserveOneByOne(block_, u, v, wanted); }
  static void StoreWinners(std::uint16_t* winners, std::uint64_t taken, std::uint16_t winner) {
    StoreWinnersOneByOne(winners, taken, winner);
  }

 private:
  const KernelBlock& block_;
};

constexpr GatherKernel kKernel{"scalar", GatherInto<ScalarView>, WouldWin<ScalarView>, SquaresThatMayKnow<ScalarView>};

}  // namespace

const GatherKernel* ScalarKernel() { return &kKernel; }

}  // namespace moondb
