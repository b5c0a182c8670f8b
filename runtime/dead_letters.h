// DeadLetters: the last messages that actors failed at, for whoever looks for the cause.
//
// A ring, bounded in number and in bytes. Not thread-safe.
#pragma once

#include <cstdint>
#include <deque>
#include <string>

#include "proto/trace.pb.h"
#include "runtime/actor.h"
#include "runtime/mailbox.h"

namespace moondb {

class DeadLetters {
 public:
  static constexpr std::size_t kLettersMax = 32;
  static constexpr std::size_t kBytesMax = 8 * 1024 * 1024;  // Of all kept messages, as serialised.

  struct Letter {
    MonotonicTime time;
    std::string actor;  // The one that failed.
    Address sender;
    OwnedMessage message = nullptr;  // None for one that alone passes kBytesMax, and for a failure in OnStart.
    std::uint16_t body = 0;          // proto::Message::BodyCase.
    std::size_t bytes = 0;
    Error error;
  };

  // `item` is what `actor` failed at, whose message is taken; null in OnStart.
  void Add(MonotonicTime time, const std::string& actor, Mailbox::Item* item, Error error);

  // Those of request.actor, or all; oldest first.
  void Report(const proto::TraceRequest& request, MonotonicTime now, proto::TraceReply* reply) const;

  const std::deque<Letter>& letters() const { return letters_; }  // Oldest first.
  std::uint64_t count() const { return count_; }                  // Ever added.

 private:
  std::deque<Letter> letters_;
  std::size_t bytes_ = 0;  // Of the kept messages.
  std::uint64_t count_ = 0;
};

}  // namespace moondb
