// LinkHealth: detects by timeouts whether the peer at the other end of a connection is still alive.
//
// ZMTP's own heartbeat is not used: under a flood it never detects a frozen peer, and it wakes an idle agent ten times
// a second. Here a peer must be heard only while an answer is expected: while sent bytes are unreported, or after a
// request for a report. An idle link is probed rarely. A peer that sends but reports no progress while frames wait for
// credit is `kStalled`, and its connection is treated as broken.
//
// A peer answers over its own link to this agent. When this agent's link opens, the peer's link may still be in its
// handshake, which takes seconds on a busy computer with many agents. The first answer may therefore take
// first_answer_after.
//
// Reads no clock: each call passes the time in. The caller provides the locking.
#pragma once

#include <chrono>
#include <optional>

#include "runtime/actor.h"

namespace moondb {

class LinkHealth {
 public:
  struct Options {
    Duration ask_after = std::chrono::seconds(1);  // Silence before the peer is asked, while an answer is expected.
    // Silence before the peer counts as lost, while an answer is expected. Longer than ask_after plus one round trip.
    Duration lost_after = std::chrono::seconds(3);
    Duration keep_alive_after = std::chrono::seconds(30);  // Silence before an idle peer is asked.
    // Silence after which a peer that was not heard since the link opened counts as lost. At least lost_after.
    Duration first_answer_after = std::chrono::seconds(15);
  };

  enum class Step {
    kNone,
    kAsk,      // Send a report that requests one from the peer.
    kLost,     // The peer was silent for too long.
    kStalled,  // The peer was heard but reported no progress for lost_after, while frames wait.
  };

  explicit LinkHealth(const Options& options) : options_(options) {}

  void OnOpened(MonotonicTime now);
  void OnHeard(MonotonicTime now);     // Any frame arrived.
  void OnProgress(MonotonicTime now);  // The peer reported more bytes.

  // Updates what is expected: `has_unreported` if sent bytes are unreported, `is_blocked` if frames wait for credit.
  void Expect(MonotonicTime now, bool has_unreported, bool is_blocked);

  // Returns the step to take now. Returns kAsk once per request; the caller must then send the request. `patience`
  // extends the deadlines while a large frame is in flight.
  Step Check(MonotonicTime now, Duration patience);
  // Time at which Check must be called next.
  MonotonicTime deadline(Duration patience) const;

 private:
  struct Next {
    MonotonicTime at;
    Step step;
  };
  // Returns the next step of a wait that started at `since`: first kAsk, then `end`.
  Next NextOfWait(MonotonicTime since, const std::optional<MonotonicTime>& asked, Step end, Duration patience) const;
  Next FindNext(Duration patience) const;

  Options options_;
  bool is_heard_ = false;                         // True if the peer was heard since the link opened.
  MonotonicTime heard_{};                         // Last time the peer was heard or the link opened.
  std::optional<MonotonicTime> expecting_since_;  // Start of the current wait for reports of sent bytes.
  std::optional<MonotonicTime> blocked_since_;
  std::optional<MonotonicTime> asked_;  // Time of the last request, if the peer was not heard since.
  // Time of the last request while blocked, if nothing was reported since.
  std::optional<MonotonicTime> asked_as_blocked_;
};

}  // namespace moondb
