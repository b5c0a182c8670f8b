// BlockMatrix: a symmetric sparse matrix of small dense blocks, one row and column of blocks for each node, of which
// the lower triangle is stored.
//
// Nodes follow each other in an approximate minimum degree order of the blocks (Amestoy, Davis and Duff, 1996), so that
// a Cholesky factorisation in the natural order fills in little. The pattern is found once; values are summed again and
// again without a search. Plain values.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <array>
#include <cstddef>
#include <utility>
#include <vector>

namespace moondb {

class BlockMatrix {
 public:
  static constexpr int kBlockSizeMax = 3;
  using Block = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kBlockSizeMax, kBlockSizeMax>;
  using NodePair = std::pair<std::size_t, std::size_t>;  // Of two nodes that differ.

  // `sizes`: unknowns of each node, 0 to 3. `pairs` may repeat, and one of whose nodes has no unknowns has no block.
  BlockMatrix(const std::vector<int>& sizes, const std::vector<NodePair>& pairs);

  Eigen::Index size() const { return lower_.rows(); }
  Eigen::Index FirstOf(std::size_t node) const { return first_[node]; }  // Of its unknowns; -1: it has none.
  const Eigen::SparseMatrix<double>& lower() const { return lower_; }

  void SetZero();
  // Of a node without unknowns nothing is added. The block of a pair has the rows of its first node.
  void AddToNode(std::size_t node, const Block& block);
  void AddToPair(std::size_t pair, const Block& block);

 private:
  // Where each column of a block begins in the array of values.
  using Columns = std::array<Eigen::Index, kBlockSizeMax>;

  void OrderNodes(const std::vector<int>& sizes, const std::vector<NodePair>& pairs);
  void MakePattern(const std::vector<int>& sizes, const std::vector<NodePair>& pairs);
  Columns FindColumns(std::size_t row_node, std::size_t column_node, int size) const;

  std::vector<Eigen::Index> first_;
  std::vector<Columns> node_columns_;
  std::vector<Columns> pair_columns_;
  std::vector<bool> is_turned_;  // Pairs whose second node comes later: their block is stored transposed.
  Eigen::SparseMatrix<double> lower_;
};

}  // namespace moondb
