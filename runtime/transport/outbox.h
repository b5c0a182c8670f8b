// Outbox: messages that wait for one peer, bounded, in the order of their classes and within a class as they came.
//
// A message with a key takes the place of the waiting one with that key. Small ones without that wait next to each
// other share a frame: libzmq, the encryption and the radio ask their price for each. When the outbox is full, messages
// of the control class still enter through a small reserve, so that bulk data never keep a role change or an
// acknowledgment out. Not thread-safe: its owner guards it.
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
    std::size_t bytes_max = 256 * 1024;  // A larger message fits alone.
    std::size_t messages_max = 4096;
    std::size_t reserve_bytes = 32 * 1024;  // Messages of the control class have so much whatever else waits.
    std::size_t reserve_messages = 256;
  };

  struct Entry {
    std::string frame;                           // proto::PeerFrame.
    std::size_t messages = 1;                    // In it.
    std::size_t outbound_class = kControlClass;  // Below kOutboundClasses.
    std::string key;                             // Empty: replaces nothing. Else the frame is not shared.
  };

  explicit Outbox(const Options& options) : options_(options) {}

  // From now on; at most kSharedFrameBytesMax. Before: no frame is shared.
  void ShareFrames(std::size_t bytes_max) { shared_frame_bytes_max_ = bytes_max; }

  // Of one message. kAccepted or kFull; an entry that is refused is left as it was.
  SendResult Push(Entry&& entry);

  const Entry* Front() const;  // Of the first class that has any; null if empty. Valid until anything else is called.
  Entry* Front();
  void PopFront();
  std::size_t Clear();  // How many messages were dropped.

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
  std::size_t control_messages_ = 0;  // Waiting messages that are control messages.
  std::size_t control_bytes_ = 0;
  std::uint64_t replaced_ = 0;
};

}  // namespace moondb
