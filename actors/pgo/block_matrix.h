// BlockMatrix: a symmetric sparse matrix of small dense blocks, with one block row and block column per node. Stores
// the lower triangle.
//
// Nodes are ordered by approximate minimum degree (Amestoy, Davis and Duff, 1996), so a Cholesky factorisation in
// natural order causes little fill-in. The constructor computes the sparsity pattern. AddToNode and AddToPair then add
// values without a search.
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
  using NodePair = std::pair<std::size_t, std::size_t>;  // Requires: the two nodes differ.

  // `sizes`: number of unknowns of each node, 0 to 3. `pairs`: pairs of nodes that get an off-diagonal block; may
  // contain duplicates. A pair with a node that has no unknowns gets no block.
  BlockMatrix(const std::vector<int>& sizes, const std::vector<NodePair>& pairs);

  Eigen::Index size() const { return lower_.rows(); }
  // Returns the index of the node's first unknown; -1 if the node has none.
  Eigen::Index FirstOf(std::size_t node) const { return first_[node]; }
  const Eigen::SparseMatrix<double>& lower() const { return lower_; }

  void SetZero();
  // Adds `block` to the block of a node, or of a pair given by its index in `pairs`. Does nothing for a node without
  // unknowns. The block of a pair has the rows of the pair's first node and the columns of the pair's second node.
  void AddToNode(std::size_t node, const Block& block);
  void AddToPair(std::size_t pair, const Block& block);

 private:
  // For each column of a block: the offset of its first row in lower_.valuePtr(), or -1 if the block has fewer columns.
  using Columns = std::array<Eigen::Index, kBlockSizeMax>;

  void OrderNodes(const std::vector<int>& sizes, const std::vector<NodePair>& pairs);
  void MakePattern(const std::vector<int>& sizes, const std::vector<NodePair>& pairs);
  Columns FindColumns(std::size_t row_node, std::size_t column_node, int size) const;

  std::vector<Eigen::Index> first_;
  std::vector<Columns> node_columns_;
  std::vector<Columns> pair_columns_;
  // True for pairs whose second node has the larger index in the matrix. The block of such a pair is stored transposed.
  std::vector<bool> is_turned_;
  Eigen::SparseMatrix<double> lower_;
};

}  // namespace moondb
