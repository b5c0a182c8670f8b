#include "actors/pgo/block_matrix.h"

#include <Eigen/OrderingMethods>
#include <algorithm>

namespace moondb {

namespace {

constexpr Eigen::Index kNone = -1;

using Triplets = std::vector<Eigen::Triplet<double>>;

}  // namespace

BlockMatrix::BlockMatrix(const std::vector<int>& sizes, const std::vector<NodePair>& pairs)
    : first_(sizes.size(), kNone) {
  OrderNodes(sizes, pairs);
  MakePattern(sizes, pairs);
}

void BlockMatrix::OrderNodes(const std::vector<int>& sizes, const std::vector<NodePair>& pairs) {
  std::vector<std::size_t> nodes;
  std::vector<int> place(sizes.size(), 0);
  for (std::size_t node = 0; node < sizes.size(); ++node) {
    if (sizes[node] == 0) continue;
    place[node] = static_cast<int>(nodes.size());
    nodes.push_back(node);
  }
  Triplets entries;
  for (std::size_t i = 0; i < nodes.size(); ++i) entries.emplace_back(static_cast<int>(i), static_cast<int>(i), 1);
  for (const auto& [a, b] : pairs) {
    if (sizes[a] == 0 || sizes[b] == 0) continue;
    entries.emplace_back(place[a], place[b], 1);
    entries.emplace_back(place[b], place[a], 1);
  }
  const auto count = static_cast<Eigen::Index>(nodes.size());
  Eigen::SparseMatrix<double> joined(count, count);
  joined.setFromTriplets(entries.begin(), entries.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
  Eigen::AMDOrdering<int>()(joined, order);
  Eigen::Index next = 0;
  for (Eigen::Index i = 0; i < count; ++i) {
    const std::size_t node = nodes[static_cast<std::size_t>(order.indices()[i])];
    first_[node] = next;
    next += sizes[node];
  }
  lower_.resize(next, next);
}

void BlockMatrix::MakePattern(const std::vector<int>& sizes, const std::vector<NodePair>& pairs) {
  Triplets entries;
  const auto fill = [&](std::size_t row_node, std::size_t column_node) {
    for (int row = 0; row < sizes[row_node]; ++row) {
      for (int column = 0; column < sizes[column_node]; ++column) {
        const Eigen::Index i = first_[row_node] + row;
        const Eigen::Index j = first_[column_node] + column;
        if (i >= j) entries.emplace_back(static_cast<int>(i), static_cast<int>(j), 0);
      }
    }
  };
  for (std::size_t node = 0; node < sizes.size(); ++node) fill(node, node);
  for (const auto& [a, b] : pairs) {
    is_turned_.push_back(first_[a] < first_[b]);
    is_turned_.back() ? fill(b, a) : fill(a, b);
  }
  lower_.setFromTriplets(entries.begin(), entries.end());
  for (std::size_t node = 0; node < sizes.size(); ++node) node_columns_.push_back(FindColumns(node, node, sizes[node]));
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const std::size_t row_node = is_turned_[i] ? pairs[i].second : pairs[i].first;
    const std::size_t column_node = is_turned_[i] ? pairs[i].first : pairs[i].second;
    pair_columns_.push_back(FindColumns(row_node, column_node, sizes[row_node] == 0 ? 0 : sizes[column_node]));
  }
}

// Returns only the offset of the first row in each column, because the rows of a node are contiguous in every column.
BlockMatrix::Columns BlockMatrix::FindColumns(std::size_t row_node, std::size_t column_node, int size) const {
  Columns columns = {kNone, kNone, kNone};
  for (int column = 0; column < size; ++column) {
    const Eigen::Index j = first_[column_node] + column;
    const Eigen::Index row = row_node == column_node ? j : first_[row_node];
    const int* const begin = lower_.innerIndexPtr() + lower_.outerIndexPtr()[j];
    const int* const end = lower_.innerIndexPtr() + lower_.outerIndexPtr()[j + 1];
    columns[static_cast<std::size_t>(column)] =
        std::lower_bound(begin, end, static_cast<int>(row)) - lower_.innerIndexPtr();
  }
  return columns;
}

void BlockMatrix::SetZero() { std::fill(lower_.valuePtr(), lower_.valuePtr() + lower_.nonZeros(), 0); }

void BlockMatrix::AddToNode(std::size_t node, const Block& block) {
  const Columns& columns = node_columns_[node];
  for (int column = 0; column < block.cols() && columns[static_cast<std::size_t>(column)] != kNone; ++column) {
    double* const values = lower_.valuePtr() + columns[static_cast<std::size_t>(column)];
    for (int row = column; row < block.rows(); ++row) values[row - column] += block(row, column);
  }
}

void BlockMatrix::AddToPair(std::size_t pair, const Block& block) {
  const Columns& columns = pair_columns_[pair];
  const bool is_turned = is_turned_[pair];
  const Eigen::Index column_count = is_turned ? block.rows() : block.cols();
  const Eigen::Index row_count = is_turned ? block.cols() : block.rows();
  for (int column = 0; column < column_count && columns[static_cast<std::size_t>(column)] != kNone; ++column) {
    double* const values = lower_.valuePtr() + columns[static_cast<std::size_t>(column)];
    for (int row = 0; row < row_count; ++row) values[row] += is_turned ? block(column, row) : block(row, column);
  }
}

}  // namespace moondb
