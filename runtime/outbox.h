// Outbox: frames that wait for one socket, bounded, in the order of their classes and within a class as they came.
//
// A frame with a key takes the place of the waiting one with that key. When it is full, frames of the control class
// still enter through a small reserve, so that bulk data never keep a role change or an acknowledgment out. Not
// thread-safe: its owner guards it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>

#include "runtime/actor.h"
#include "runtime/outbound.h"
#include "runtime/zmq_socket.h"

namespace moondb {

class Outbox {
 public:
  struct Options {
    std::size_t bytes_max = 256 * 1024;  // A larger frame fits alone.
    std::size_t frames_max = 4096;
    std::size_t reserve_bytes = 32 * 1024;  // Frames of the control class have so much whatever else waits.
    std::size_t reserve_frames = 256;
  };

  struct Entry {
    ZmqFrame frame;
    std::size_t bytes = 0;                       // Of the frame.
    std::size_t outbound_class = kControlClass;  // Below kOutboundClasses.
    std::string key;                             // Empty: replaces nothing.
  };

  explicit Outbox(const Options& options) : options_(options) {}

  // kAccepted or kFull; an entry that is refused is left as it was.
  SendResult Push(Entry&& entry);

  const Entry* Front() const;  // Of the first class that has any; null if empty. Valid until anything else is called.
  Entry* Front();
  void PopFront();
  std::size_t Clear();  // How many were dropped.

  bool empty() const { return frames_ == 0; }
  std::size_t frames() const { return frames_; }
  std::size_t bytes() const { return bytes_; }
  std::uint64_t replaced() const { return replaced_; }

 private:
  bool HasRoomFor(const Entry& entry) const;
  void CountIn(const Entry& entry);
  void CountOut(const Entry& entry);
  Entry* FindWaiting(const Entry& entry);

  Options options_;
  std::array<std::deque<Entry>, kOutboundClasses> classes_;
  std::size_t frames_ = 0;
  std::size_t bytes_ = 0;
  std::size_t control_bytes_ = 0;  // Of these.
  std::uint64_t replaced_ = 0;
};

}  // namespace moondb
