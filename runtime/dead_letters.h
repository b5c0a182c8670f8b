// DeadLetters: the latest failures of actors with the messages that caused them, for diagnosis.
//
// Keeps at most kLettersMax letters and kBytesMax bytes, and drops the oldest ones first. Not thread-safe.
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
  static constexpr std::size_t kBytesMax = 8 * 1024 * 1024;  // Serialised bytes of all kept messages.

  struct Letter {
    MonotonicTime time;
    std::string actor;  // The actor that failed.
    Address sender;
    OwnedMessage message = nullptr;  // Null if the message exceeds kBytesMax, or if OnStart failed.
    std::uint16_t body = 0;          // Body of the message, a proto::Message::BodyCase.
    std::size_t bytes = 0;
    Error error;
  };

  // Adds a failure of `actor`. `item` holds the message whose handler failed; null if OnStart failed. If the message is
  // kept, it is moved out of `item`.
  void Add(MonotonicTime time, const std::string& actor, Mailbox::Item* item, Error error);

  // Adds the letters of request.actor to `reply`, oldest first. If request.actor is empty, adds all letters.
  void Report(const proto::TraceRequest& request, MonotonicTime now, proto::TraceReply* reply) const;

  const std::deque<Letter>& letters() const { return letters_; }  // Kept letters, oldest first.
  std::uint64_t count() const { return count_; }                  // Number of letters ever added.

 private:
  std::deque<Letter> letters_;
  std::size_t bytes_ = 0;  // Serialised bytes of the kept messages.
  std::uint64_t count_ = 0;
};

}  // namespace moondb
