// Outbox: frames that wait for one socket, bounded. Any thread pushes, the transport's thread takes.
//
// A closed outbox takes nothing: its peer is not connected. What waits when it closes is dropped, since whoever sent it
// will send it again (runtime/transport.h), and stale frames would only delay that.
#pragma once

#include <cstddef>
#include <deque>
#include <mutex>
#include <string>

#include "runtime/actor.h"

namespace moondb {

class Outbox {
 public:
  struct Entry {
    std::string route;  // The client's connection; empty to a peer.
    std::string frame;
  };

  // A frame larger than `bytes_max` fits alone.
  Outbox(std::size_t bytes_max, std::size_t frames_max, bool is_open)
      : bytes_max_(bytes_max), frames_max_(frames_max), is_open_(is_open) {}

  // Any thread. kAccepted, kFull or kUnreachable.
  SendResult Push(Entry entry);
  bool is_open() const;
  bool empty() const;

  // The transport's thread only.
  void Open();
  std::size_t Close();         // How many were dropped.
  const Entry* Front() const;  // Null if empty. Valid until PopFront or Close.
  void PopFront();

 private:
  const std::size_t bytes_max_;
  const std::size_t frames_max_;
  mutable std::mutex mutex_;
  bool is_open_;
  std::size_t bytes_ = 0;
  std::deque<Entry> entries_;
};

}  // namespace moondb
