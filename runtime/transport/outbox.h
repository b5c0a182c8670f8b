// Outbox: a bounded queue of messages for one peer, ordered by class and, within a class, by arrival.
//
// A message with a replacement key (ReplaceKeyOf) replaces the waiting message with the same key. Consecutive small
// messages without a key share a frame, because each frame costs time in libzmq, encryption and radio. A small reserve
// admits control messages when the outbox is full, so that bulk data cannot block role changes or acknowledgments. Not
// thread-safe.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>

#include "runtime/actor.h"
#include "runtime/transport/outbound.h"

namespace moondb {

class Outbox {
 public:
  struct Options {
    std::size_t bytes_max = 256 * 1024;  // Limit of waiting bytes. An empty outbox accepts a larger message.
    std::size_t messages_max = 4096;
    // Control messages are accepted while their total size is within this limit, even if other messages fill the
    // outbox.
    std::size_t reserve_bytes = 32 * 1024;
    std::size_t reserve_messages = 256;
  };

  struct Entry {
    std::string frame;                           // Serialised proto::PeerFrame, without the link number.
    std::size_t messages = 1;                    // Number of messages in the frame.
    std::size_t outbound_class = kControlClass;  // Less than kOutboundClasses.
    // A message replaces the waiting message of its class that has the same key. Empty: replaces none. A message with a
    // key has its own frame.
    std::string key;
  };

  explicit Outbox(const Options& options) : options_(options) {}

  // Sets the size limit of shared frames, at most kSharedFrameBytesMax. Initially no frames are shared.
  void ShareFrames(std::size_t bytes_max) { shared_frame_bytes_max_ = bytes_max; }

  // Adds an entry that holds one message. Returns kFull, and leaves the entry unchanged, if there is no room; otherwise
  // returns kAccepted.
  SendResult Push(Entry&& entry);

  // Returns the next entry to send, or null if the outbox is empty. The pointer is valid until the outbox changes.
  const Entry* Front() const;
  Entry* Front();
  void PopFront();
  std::size_t Clear();  // Returns the number of dropped messages.

  bool empty() const { return messages_ == 0; }
  std::size_t messages() const { return messages_; }
  std::size_t bytes() const { return bytes_; }
  std::uint64_t replaced() const { return replaced_; }

 private:
  bool HasRoomFor(const Entry& entry) const;
  void CountIn(const Entry& entry);
  void CountOut(const Entry& entry);
  Entry* FindWaiting(const Entry& entry);
  Entry* FrameToShare(const Entry& entry);

  Options options_;
  std::array<std::deque<Entry>, kOutboundClasses> classes_;
  std::size_t shared_frame_bytes_max_ = 0;
  std::size_t messages_ = 0;
  std::size_t bytes_ = 0;
  std::size_t control_messages_ = 0;
  std::size_t control_bytes_ = 0;
  std::uint64_t replaced_ = 0;
};

}  // namespace moondb
