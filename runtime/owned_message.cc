#include "runtime/owned_message.h"

#include <array>
#include <memory>
#include <mutex>
#include <new>
#include <string>
#include <utility>
#include <vector>

namespace moondb {
namespace {

constexpr std::size_t kCacheLine = 64;
#if defined(__SANITIZE_ADDRESS__)
constexpr bool kUsesAgain = false;  // No reuse, so that AddressSanitizer can report a use after release.
#else
constexpr bool kUsesAgain = true;
#endif
constexpr std::size_t kPackMessages = 63;  // Messages per Pack. Threads exchange whole packs, each under one lock.
// Maximum number of packs kept for all threads together (1 MB). Further packs are freed.
constexpr std::size_t kSharedPacks = 128;
constexpr std::size_t kAhead = 4;  // A message is prefetched into the cache this many calls of Take before its use.

// Allocates a message at the start of a cache line, which it shares with no other message.
proto::Message* New() { return ::new (std::align_val_t(kCacheLine)) proto::Message; }

void Delete(proto::Message* message) {
  std::destroy_at(message);
  ::operator delete(message, std::align_val_t(kCacheLine));
}

// True if the string owns heap memory. A cleared string keeps its memory.
bool HoldsMemory(const std::string& text) { return text.capacity() > std::string().capacity(); }

// Empties a message and frees its memory, except for the string objects. Does not free unknown fields, which
// runtime/transport/inbound.cc has already removed.
void Empty(proto::Message& message) {
  const bool holds_memory = message.body_case() != proto::Message::BODY_NOT_SET || message.has_term() ||
                            HoldsMemory(message.record_id()) || HoldsMemory(message.sql()) ||
                            HoldsMemory(message.source_actor()) || HoldsMemory(message.destination_actor()) ||
                            HoldsMemory(message.client_name());
  if (!holds_memory) return message.Clear();
  std::destroy_at(&message);
  std::construct_at(&message);
}

// A stack of pointers to empty messages. Pushing and popping do not access the messages, which may be in another core's
// cache.
struct Pack {
  std::size_t count = 0;
  std::array<proto::Message*, kPackMessages> messages;

  ~Pack() {
    while (count > 0) Delete(messages[--count]);
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
  // Never destroyed: threads may release messages until the process ends.
  static SharedPacks& packs = *new SharedPacks;
  return packs;
}

// The free messages of one thread, up to two packs. Because of the second pack, alternating calls of Take and Put
// rarely access SharedPacks.
class ThreadMessages {
 public:
  ~ThreadMessages() { is_over = true; }

  proto::Message* Take() {
    if (used_->count == 0) std::swap(used_, spare_);
    if (used_->count == 0) {
      if (std::unique_ptr<Pack> pack = Shared().Take()) used_ = std::move(pack);
    }
    if (used_->count == 0) return New();
    proto::Message* message = used_->messages[--used_->count];
    if (used_->count >= kAhead) PrefetchForWriting(used_->messages[used_->count - kAhead]);
    return message;
  }

  void Put(proto::Message* message) {
    if (used_->count == kPackMessages) {
      std::swap(used_, spare_);
      if (used_->count == kPackMessages) {
        Shared().Put(std::move(used_));
        used_ = std::make_unique<Pack>();
      }
    }
    used_->messages[used_->count++] = message;
  }

  static thread_local bool is_over;  // True once the thread is ending and its packs are destroyed.

 private:
  static void PrefetchForWriting(const proto::Message* message) {
    __builtin_prefetch(message, 1);
    __builtin_prefetch(reinterpret_cast<const char*>(message) + kCacheLine, 1);
  }

  std::unique_ptr<Pack> used_ = std::make_unique<Pack>();
  std::unique_ptr<Pack> spare_ = std::make_unique<Pack>();
};

thread_local bool ThreadMessages::is_over = false;
thread_local ThreadMessages thread_messages;

}  // namespace

OwnedMessage::OwnedMessage() : message_(kUsesAgain && !ThreadMessages::is_over ? thread_messages.Take() : New()) {}

void OwnedMessage::LetGo(proto::Message* message) {
  if (!kUsesAgain || ThreadMessages::is_over) return Delete(message);
  Empty(*message);
  thread_messages.Put(message);
}

}  // namespace moondb
