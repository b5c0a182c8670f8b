// OwnedMessage: a message with one owner, who may write it, pass it on or release it.
//
//   OwnedMessage message;
//   message->mutable_timer()->set_kind(1);
//   (void)context.Send(to, std::move(message));
//
// A moved proto::Message converts to an OwnedMessage. Writing to an OwnedMessage from the start is faster: a small
// message between actors then takes a sixth less time (measured).
//
// Released messages are emptied and reused. Often one thread allocates messages that another thread releases; with
// malloc, each such release takes a lock, which halves the throughput of two threads (measured). Memory that a message
// points to still comes from malloc and is freed on release.
#pragma once

#include <cstddef>
#include <utility>

#include "proto/message.pb.h"

namespace moondb {

// Owns a message as std::unique_ptr does. A message may be created on one thread and released on another.
class OwnedMessage {
 public:
  OwnedMessage();                  // Holds an empty message.
  OwnedMessage(std::nullptr_t) {}  // NOLINT(google-explicit-constructor): null, as for pointers.
  // NOLINTNEXTLINE(google-explicit-constructor): senders need not know this class.
  OwnedMessage(proto::Message&& message) : OwnedMessage() { message_->Swap(&message); }
  OwnedMessage(OwnedMessage&& other) noexcept : message_(std::exchange(other.message_, nullptr)) {}
  OwnedMessage& operator=(OwnedMessage&& other) noexcept {
    std::swap(message_, other.message_);
    other.Reset();
    return *this;
  }
  ~OwnedMessage() { Reset(); }

  proto::Message& operator*() const { return *message_; }
  proto::Message* operator->() const { return message_; }
  explicit operator bool() const { return message_ != nullptr; }
  friend bool operator==(const OwnedMessage& message, std::nullptr_t) { return message.message_ == nullptr; }

 private:
  void Reset() {
    if (message_ != nullptr) LetGo(std::exchange(message_, nullptr));
  }
  static void LetGo(proto::Message* message);

  proto::Message* message_ = nullptr;
};

}  // namespace moondb
