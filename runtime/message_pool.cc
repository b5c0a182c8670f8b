#include "runtime/message_pool.h"

#include <cstddef>
#include <mutex>
#include <new>
#include <utility>
#include <vector>

namespace moondb {
namespace {

constexpr std::size_t kBlockBytes = 192;    // A message (112 bytes with protobuf 3.21), its count, and some air.
constexpr std::size_t kChainBlocks = 64;    // What changes hands at once.
constexpr std::size_t kSharedChains = 128;  // Kept for all threads, 1.5 MB; further ones are freed.

struct Block {
  Block* next;
};

// A chain of kChainBlocks blocks, or of fewer while a thread works on it.
struct Chain {
  Block* first = nullptr;
  std::size_t count = 0;

  void Push(Block* block) {
    block->next = first;
    first = block;
    ++count;
  }
  Block* Pop() {
    Block* block = first;
    first = block->next;
    --count;
    return block;
  }
  void Free() {
    while (count > 0) ::operator delete(Pop());
  }
};

class SharedChains {
 public:
  void Put(Chain chain) {
    {
      const std::lock_guard lock(mutex_);
      if (chains_.size() < kSharedChains) {
        chains_.push_back(chain);
        return;
      }
    }
    chain.Free();
  }
  Chain Take() {
    const std::lock_guard lock(mutex_);
    if (chains_.empty()) return {};
    const Chain chain = chains_.back();
    chains_.pop_back();
    return chain;
  }

 private:
  std::mutex mutex_;
  std::vector<Chain> chains_;
};

SharedChains& Shared() {
  // Never destroyed: threads may let messages go to the very end.
  static SharedChains& chains = *new SharedChains;
  return chains;
}

// One thread's blocks: up to two chains, so that neither giving nor taking one changes hands each time.
class ThreadBlocks {
 public:
  ~ThreadBlocks() {
    used_.Free();
    spare_.Free();
    is_over = true;
  }

  void* Allocate() {
    if (used_.count == 0) std::swap(used_, spare_);
    if (used_.count == 0) used_ = Shared().Take();
    return used_.count == 0 ? ::operator new(kBlockBytes) : used_.Pop();
  }

  void Free(void* memory) {
    if (used_.count == kChainBlocks) {
      if (spare_.count > 0) Shared().Put(spare_);
      spare_ = std::exchange(used_, {});
    }
    used_.Push(static_cast<Block*>(memory));
  }

  static thread_local bool is_over;  // This thread's have been destroyed: it is ending.

 private:
  Chain used_;
  Chain spare_;  // Empty or full.
};

thread_local bool ThreadBlocks::is_over = false;
thread_local ThreadBlocks thread_blocks;

// For std::allocate_shared, which asks for one object that holds the message and its count.
template <typename T>
struct BlockAllocator {
  using value_type = T;
  BlockAllocator() = default;
  template <typename U>
  BlockAllocator(const BlockAllocator<U>&) {}  // NOLINT(google-explicit-constructor): as the standard has it.

  T* allocate(std::size_t) {
    static_assert(sizeof(T) <= kBlockBytes && alignof(T) <= alignof(std::max_align_t));
    return static_cast<T*>(ThreadBlocks::is_over ? ::operator new(kBlockBytes) : thread_blocks.Allocate());
  }
  void deallocate(T* memory, std::size_t) {
    if (ThreadBlocks::is_over) {
      ::operator delete(memory);
    } else {
      thread_blocks.Free(memory);
    }
  }
  friend bool operator==(const BlockAllocator&, const BlockAllocator&) { return true; }
};

}  // namespace

MessagePtr MakeMessage(proto::Message&& message) {
#if defined(__SANITIZE_ADDRESS__)
  // Each in memory of its own, so that the sanitizer sees whoever uses one too long.
  return std::make_shared<const proto::Message>(std::move(message));
#else
  return std::allocate_shared<const proto::Message>(BlockAllocator<proto::Message>(), std::move(message));
#endif
}

}  // namespace moondb
