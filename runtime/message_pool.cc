#include "runtime/message_pool.h"

#include <array>
#include <cstddef>
#include <memory>
#include <mutex>
#include <new>
#include <utility>
#include <vector>

namespace moondb {
namespace {

constexpr std::size_t kCacheLine = 64;
constexpr std::size_t kBlockBytes = 2 * kCacheLine;  // A message (112 bytes with protobuf 3.21) and its count.
constexpr std::size_t kPackBlocks = 63;              // What changes hands at once.
constexpr std::size_t kSharedPacks = 128;            // Kept for all threads, 1 MB; further ones are freed.
constexpr std::size_t kBlocksAhead = 4;              // So far before its use a block is called into the cache.

void* NewBlock() { return ::operator new(kBlockBytes, std::align_val_t(kCacheLine)); }
void DeleteBlock(void* block) { ::operator delete(block, std::align_val_t(kCacheLine)); }

// Says where the blocks are, and leaves them alone: another core may have them in its cache.
struct Pack {
  std::size_t count = 0;
  std::array<void*, kPackBlocks> blocks;

  ~Pack() {
    while (count > 0) DeleteBlock(blocks[--count]);
  }
};

class SharedPacks {
 public:
  void Put(std::unique_ptr<Pack> pack) {
    const std::lock_guard lock(mutex_);
    if (packs_.size() < kSharedPacks) packs_.push_back(std::move(pack));
  }
  std::unique_ptr<Pack> Take() {
    const std::lock_guard lock(mutex_);
    if (packs_.empty()) return nullptr;
    std::unique_ptr<Pack> pack = std::move(packs_.back());
    packs_.pop_back();
    return pack;
  }

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<Pack>> packs_;
};

SharedPacks& Shared() {
  // Never destroyed: threads may let messages go to the very end.
  static SharedPacks& packs = *new SharedPacks;
  return packs;
}

// One thread's blocks: up to two packs, so that neither giving nor taking one changes hands each time.
class ThreadBlocks {
 public:
  ~ThreadBlocks() { is_over = true; }

  void* Allocate() {
    if (used_->count == 0) std::swap(used_, spare_);
    if (used_->count == 0) {
      if (std::unique_ptr<Pack> pack = Shared().Take()) used_ = std::move(pack);
    }
    if (used_->count == 0) return NewBlock();
    void* block = used_->blocks[--used_->count];
    if (used_->count >= kBlocksAhead) PrefetchForWriting(used_->blocks[used_->count - kBlocksAhead]);
    return block;
  }

  void Free(void* block) {
    if (used_->count == kPackBlocks) {
      std::swap(used_, spare_);
      if (used_->count == kPackBlocks) {
        Shared().Put(std::move(used_));
        used_ = std::make_unique<Pack>();
      }
    }
    used_->blocks[used_->count++] = block;
  }

  static thread_local bool is_over;  // This thread's have been destroyed: it is ending.

 private:
  static void PrefetchForWriting(const void* block) {
    __builtin_prefetch(block, 1);
    __builtin_prefetch(static_cast<const char*>(block) + kCacheLine, 1);
  }

  std::unique_ptr<Pack> used_ = std::make_unique<Pack>();
  std::unique_ptr<Pack> spare_ = std::make_unique<Pack>();
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
    static_assert(sizeof(T) <= kBlockBytes && alignof(T) <= kCacheLine);
    return static_cast<T*>(ThreadBlocks::is_over ? NewBlock() : thread_blocks.Allocate());
  }
  void deallocate(T* memory, std::size_t) {
    if (ThreadBlocks::is_over) {
      DeleteBlock(memory);
    } else {
      thread_blocks.Free(memory);
    }
  }
  friend bool operator==(const BlockAllocator&, const BlockAllocator&) { return true; }
};

template <typename... Parts>
std::shared_ptr<proto::Message> Make(Parts&&... parts) {
#if defined(__SANITIZE_ADDRESS__)
  // Each in memory of its own, so that the sanitizer sees whoever uses one too long.
  return std::make_shared<proto::Message>(std::forward<Parts>(parts)...);
#else
  return std::allocate_shared<proto::Message>(BlockAllocator<proto::Message>(), std::forward<Parts>(parts)...);
#endif
}

}  // namespace

std::shared_ptr<proto::Message> MakeMessage(proto::Message&& message) { return Make(std::move(message)); }

std::shared_ptr<proto::Message> MakeMessage() { return Make(); }

}  // namespace moondb
