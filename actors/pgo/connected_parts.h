// ConnectedParts: the connected components of a graph with numbered elements (union-find).
#pragma once

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <vector>

namespace moondb {

class ConnectedParts {
 public:
  explicit ConnectedParts(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), std::size_t{0});
  }

  void Join(std::size_t a, std::size_t b) {
    const std::size_t head_a = HeadOf(a);
    const std::size_t head_b = HeadOf(b);
    parent_[std::max(head_a, head_b)] = std::min(head_a, head_b);
  }

  // Returns the lowest element of the component that contains `thing`.
  std::size_t HeadOf(std::size_t thing) {
    while (parent_[thing] != thing) thing = parent_[thing] = parent_[parent_[thing]];
    return thing;
  }

 private:
  std::vector<std::size_t> parent_;
};

}  // namespace moondb
