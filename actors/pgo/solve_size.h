// EstimateSolveSize: estimates the size of the Cholesky factor of a pose graph, before a solve.
//
// Ceres factorises the normal equations. Each node is one block row; two nodes joined by an edge share a block, and the
// factorisation adds further blocks (fill-in). Nodes are eliminated in approximate minimum degree order, which keeps
// the fill-in small. A chain of n nodes has 2n blocks; n nodes that are all joined to each other have n^2/2 blocks in
// any order. Each block of the factor takes 288 bytes.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

namespace moondb {

struct SolveSize {
  std::uint64_t blocks = 0;    // Number of blocks in the factor.
  std::uint64_t products = 0;  // Approximate number of multiplications of two blocks per factorisation.
};

// Counts the blocks and products of a solve of node_count nodes. `joined`: pairs of nodes by index, 0 to node_count -
// 1; may contain duplicates. Counting stops once the number of blocks or products exceeds `limit`.
SolveSize EstimateSolveSize(std::size_t node_count, const std::vector<std::pair<int, int>>& joined,
                            const SolveSize& limit);

inline bool IsWithin(const SolveSize& size, const SolveSize& limit) {
  return size.blocks <= limit.blocks && size.products <= limit.products;
}

}  // namespace moondb
