#include "actors/pgo/solve_size.h"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>

namespace moondb {

SolveSize EstimateSolveSize(std::size_t node_count, const std::vector<std::pair<int, int>>& joined,
                            const SolveSize& limit) {
  using Matrix = Eigen::SparseMatrix<double>;
  const int size = static_cast<int>(node_count);
  std::vector<Eigen::Triplet<double>> places;
  places.reserve(2 * joined.size() + node_count);
  for (int node = 0; node < size; ++node) places.emplace_back(node, node, 1);
  for (const auto& [a, b] : joined) {
    places.emplace_back(a, b, 1);
    places.emplace_back(b, a, 1);
  }
  Matrix matrix(size, size);
  matrix.setFromTriplets(places.begin(), places.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> node_of_step;
  Eigen::AMDOrdering<int>()(matrix, node_of_step);
  std::vector<int> step_of_node(node_count);
  for (int step = 0; step < size; ++step) step_of_node[static_cast<std::size_t>(node_of_step.indices()[step])] = step;

  // Symbolic Cholesky factorisation. For each row of the factor, follow the elimination tree from each matrix entry up
  // to the first node already visited for this row.
  SolveSize found;
  std::vector<int> parent(node_count, -1);
  std::vector<int> seen_in(node_count, -1);
  std::vector<std::uint64_t> column_blocks(node_count, 0);
  for (int row = 0; row < size && IsWithin(found, limit); ++row) {
    seen_in[static_cast<std::size_t>(row)] = row;
    ++found.blocks;
    for (Matrix::InnerIterator entry(matrix, node_of_step.indices()[row]); entry; ++entry) {
      auto column = static_cast<std::size_t>(step_of_node[static_cast<std::size_t>(entry.row())]);
      if (static_cast<int>(column) > row) continue;
      while (seen_in[column] != row) {
        if (parent[column] < 0) parent[column] = row;
        seen_in[column] = row;
        ++found.blocks;
        found.products += ++column_blocks[column];
        column = static_cast<std::size_t>(parent[column]);
      }
    }
  }
  return found;
}

}  // namespace moondb
