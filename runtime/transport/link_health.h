// LinkHealth: whether the peer at the other end of a connection is still there, by when it was last heard.
//
// ZMTP's own heartbeat is not used: under a flood it never finds a frozen peer, and it wakes an idle agent ten times a
// second. Here a peer has to be heard only while something is expected of it: while bytes that it was sent are
// unreported, and after it was asked. An idle link is asked once in a long while. A peer that talks but lets us wait
// for credit is `kStalled`: it is broken.
//
// A peer answers over its own link to this agent. When this agent's link opens, the peer's link may still be in its
// handshake, which takes seconds on a busy computer with many agents. So the first answer may take first_answer_after.
//
// Pure: time comes in with each call. Its owner guards it.
#pragma once

#include <chrono>
#include <optional>

#include "runtime/actor.h"

namespace moondb {

class LinkHealth {
 public:
  struct Options {
    Duration ask_after = std::chrono::seconds(1);          // Of silence while something is expected.
    Duration lost_after = std::chrono::seconds(3);         // Likewise; longer than ask_after and one round trip.
    Duration keep_alive_after = std::chrono::seconds(30);  // Of silence while nothing is expected.
    // The longest silence after the link opened; at least lost_after.
    Duration first_answer_after = std::chrono::seconds(15);
  };

  enum class Step {
    kNone,
    kAsk,      // Send the peer a report that asks for one.
    kLost,     // Silent for too long.
    kStalled,  // Heard, but nothing was reported for as long, while frames wait for it.
  };

  explicit LinkHealth(const Options& options) : options_(options) {}

  void OnOpened(MonotonicTime now);
  void OnHeard(MonotonicTime now);     // Any frame.
  void OnProgress(MonotonicTime now);  // More bytes are reported.

  // Whether bytes are unreported, and whether frames wait for credit.
  void Expect(MonotonicTime now, bool has_unreported, bool is_blocked);

  // What is to be done; each step is given once, kAsk is then taken as done. `patience`: that much longer, because a
  // frame is under way which takes its time.
  Step Check(MonotonicTime now, Duration patience);
  // When to Check again.
  MonotonicTime deadline(Duration patience) const;

 private:
  struct Next {
    MonotonicTime at;
    Step step;
  };
  // Of a wait that began at `since`: first ask, then end it.
  Next NextOfWait(MonotonicTime since, const std::optional<MonotonicTime>& asked, Step end, Duration patience) const;
  Next FindNext(Duration patience) const;

  Options options_;
  bool is_heard_ = false;                         // Since the link opened.
  MonotonicTime heard_{};                         // Or opened.
  std::optional<MonotonicTime> expecting_since_;  // Bytes are unreported.
  std::optional<MonotonicTime> blocked_since_;
  std::optional<MonotonicTime> asked_;             // And not heard since.
  std::optional<MonotonicTime> asked_as_blocked_;  // And nothing reported since.
};

}  // namespace moondb
