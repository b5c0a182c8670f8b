// EstimateSolveSize: how large the Cholesky factor of a pose graph becomes.
//
// Ceres factorizes the normal equations, whose blocks are nodes; two nodes that an edge joins share a block, and the
// factorization fills further blocks in. Nodes are eliminated in an order that keeps the fill small (approximate
// minimum degree). A chain of n nodes has 2n blocks, n nodes that are all joined with each other n^2/2, whatever the
// order. Each block of the factor takes 288 bytes.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

namespace moondb {

struct SolveSize {
  std::uint64_t blocks = 0;    // Blocks of the factor.
  std::uint64_t products = 0;  // Multiplications of two blocks that one factorization takes, about.
};

// Joined nodes by their places 0 to node_count - 1; a pair may come twice. Counting ends once either number is beyond
// that of `limit`.
SolveSize EstimateSolveSize(std::size_t node_count, const std::vector<std::pair<int, int>>& joined,
                            const SolveSize& limit);

inline bool IsWithin(const SolveSize& size, const SolveSize& limit) {
  return size.blocks <= limit.blocks && size.products <= limit.products;
}

}  // namespace moondb
