// Fifo: a queue in a vector. Where it mostly runs empty between uses, as an actor's mailbox does, it begins anew at the
// same place, in the cache, and all of it can change hands at once; a std::deque wanders through memory.
//
// Amortised constant time. Not thread-safe.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

namespace moondb {

template <typename T>
class Fifo {
 public:
  bool empty() const { return items_.empty(); }
  std::size_t size() const { return items_.size() - first_; }
  T& front() { return items_[first_]; }
  T& back() { return items_.back(); }
  T& operator[](std::size_t index) { return items_[first_ + index]; }

  void push_back(T&& item) { items_.push_back(std::move(item)); }

  T pop_front() {
    T item = std::move(items_[first_]);
    if (++first_ == items_.size()) {
      clear();
    } else if (first_ >= kGapMax && first_ * 2 >= items_.size()) {
      items_.erase(items_.begin(), items_.begin() + static_cast<std::ptrdiff_t>(first_));
      first_ = 0;
    }
    return item;
  }

  void swap(Fifo& other) {
    items_.swap(other.items_);
    std::swap(first_, other.first_);
  }

  void clear() {
    items_.clear();
    first_ = 0;
  }

 private:
  static constexpr std::size_t kGapMax = 64;

  std::vector<T> items_;
  std::size_t first_ = 0;  // Those before it were popped.
};

}  // namespace moondb
