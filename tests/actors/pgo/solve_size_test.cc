#include "actors/pgo/solve_size.h"

#include <gtest/gtest.h>

#include <random>
#include <set>

namespace moondb {
namespace {

constexpr SolveSize kNoLimit{UINT64_MAX, UINT64_MAX};

// Returns the number of blocks of the Cholesky factor if the nodes are eliminated in the order of their indices. The
// elimination of a node connects all its later neighbours with each other.
std::uint64_t BlocksInOrder(std::size_t node_count, const std::vector<std::pair<int, int>>& joined) {
  std::vector<std::set<int>> later(node_count);
  for (const auto& [a, b] : joined) {
    if (a != b) later[static_cast<std::size_t>(std::min(a, b))].insert(std::max(a, b));
  }
  std::uint64_t blocks = node_count;
  for (std::size_t node = 0; node < node_count; ++node) {
    blocks += later[node].size();
    for (const int a : later[node]) {
      for (const int b : later[node]) {
        if (b > a) later[static_cast<std::size_t>(a)].insert(b);
      }
    }
  }
  return blocks;
}

TEST(SolveSizeTest, AChainHasNoFillIn) {
  std::vector<std::pair<int, int>> joined;
  for (int node = 1; node < 1000; ++node) joined.emplace_back(node - 1, node);
  EXPECT_EQ(EstimateSolveSize(1000, joined, kNoLimit).blocks, 1999u);
}

TEST(SolveSizeTest, FullyConnectedNodesFillTheFactor) {
  std::vector<std::pair<int, int>> joined;
  for (int a = 0; a < 100; ++a) {
    for (int b = 0; b < a; ++b) joined.emplace_back(b, a);
  }
  const SolveSize size = EstimateSolveSize(100, joined, kNoLimit);
  EXPECT_EQ(size.blocks, 100u * 101 / 2);
  EXPECT_EQ(size.products, 99u * 100 * 101 / 6) << "the sum of k (k + 1) / 2 for k below 100";
}

TEST(SolveSizeTest, ARandomGraphHasNoMoreFillInThanInItsOwnOrder) {
  const std::uint64_t seed = std::random_device()();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 rng(seed);
  std::vector<std::pair<int, int>> joined;
  for (int node = 1; node < 200; ++node) joined.emplace_back(node - 1, node);
  for (int edge = 0; edge < 200; ++edge) joined.emplace_back(rng() % 200, rng() % 200);
  const SolveSize size = EstimateSolveSize(200, joined, kNoLimit);
  EXPECT_LT(size.blocks, BlocksInOrder(200, joined));
  EXPECT_GT(size.blocks, 500u);
}

TEST(SolveSizeTest, CountingStopsBeyondTheLimit) {
  std::vector<std::pair<int, int>> joined;
  for (int a = 0; a < 1000; ++a) {
    for (int b = 0; b < a; ++b) joined.emplace_back(b, a);
  }
  const SolveSize size = EstimateSolveSize(1000, joined, {1000, UINT64_MAX});
  EXPECT_GT(size.blocks, 1000u);
  EXPECT_LT(size.blocks, 4000u);
}

}  // namespace
}  // namespace moondb
