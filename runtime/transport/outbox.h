// Outbox: a bounded queue of messages for one peer, ordered by class and, within a class, by arrival.
//
// A message with a key replaces the waiting message with the same key. Adjacent small messages without a key share a
// frame, because each frame costs time in libzmq, encryption and radio. A small reserve admits control messages when
// the outbox is full, so that bulk data cannot block role changes or acknowledgments. Not thread-safe.
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
    std::size_t bytes_max = 256 * 1024;  // A larger message is accepted if nothing waits.
    std::size_t messages_max = 4096;
    std::size_t reserve_bytes = 32 * 1024;  // Control messages are accepted up to this size, whatever else waits.
    std::size_t reserve_messages = 256;
  };

  struct Entry {
    std::string frame;                           // Serialised proto::PeerFrame, without the link number.
    std::size_t messages = 1;                    // Number of messages in the frame.
    std::size_t outbound_class = kControlClass;  // Less than kOutboundClasses.
    std::string key;  // Replacement key. Empty: replaces nothing. A frame with a key is not shared.
  };

  explicit Outbox(const Options& options) : options_(options) {}

  // Sets the size limit of shared frames, at most kSharedFrameBytesMax. Initially no frames are shared.
  void ShareFrames(std::size_t bytes_max) { shared_frame_bytes_max_ = bytes_max; }

  // Adds an entry with one message. Returns kAccepted or kFull; a refused entry is not changed.
  SendResult Push(Entry&& entry);

  // First entry of the first non-empty class; null if empty. Valid until the outbox changes.
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
  std::size_t control_messages_ = 0;  // Number of waiting control messages.
  std::size_t control_bytes_ = 0;
  std::uint64_t replaced_ = 0;
};

}  // namespace moondb
