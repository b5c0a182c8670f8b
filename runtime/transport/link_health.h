// LinkHealth: detects by timeouts whether the peer at the other end of a connection is still alive.
//
// Silence counts against the peer only while an answer is expected: while sent bytes are unreported, or after a request
// for a report. An idle peer is asked for a report rarely. A peer that sends but reports no progress while frames wait
// for credit is `kStalled`.
//
// ZMTP's heartbeat is not used: under a flood it never detects a frozen peer, and it wakes an idle agent ten times a
// second.
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
    // While an answer is expected, the peer is asked for a report after this much silence.
    Duration ask_after = std::chrono::seconds(1);
    // While an answer is expected, the peer counts as lost after this much silence. Longer than ask_after plus one
    // round trip.
    Duration lost_after = std::chrono::seconds(3);
    // An idle peer is asked for a report after this much silence.
    Duration keep_alive_after = std::chrono::seconds(30);
    // Used instead of lost_after until the peer is first heard after the link opened. The peer answers over its own
    // link, whose handshake may take seconds on a busy computer. At least lost_after.
    Duration first_answer_after = std::chrono::seconds(15);
  };

  enum class Step {
    kNone,
    kAsk,   // Send a report that requests a report from the peer.
    kLost,  // The peer was silent for too long.
    // The peer was heard, but reported no progress for lost_after while frames waited for credit.
    kStalled,
  };

  explicit LinkHealth(const Options& options) : options_(options) {}

  void OnOpened(MonotonicTime now);
  void OnHeard(MonotonicTime now);     // Any frame arrived.
  void OnProgress(MonotonicTime now);  // The peer reported more bytes.

  // Call when one of the two values may have changed. `has_unreported`: the peer has not reported all sent bytes.
  // `is_blocked`: frames wait for credit.
  void Expect(MonotonicTime now, bool has_unreported, bool is_blocked);

  // Returns the step to take now. After kAsk, the caller must send the request. `patience` is added to the deadlines
  // for kLost and kStalled, for a large frame in flight.
  Step Check(MonotonicTime now, Duration patience);
  // Time at which Check must be called next.
  MonotonicTime deadline(Duration patience) const;

 private:
  struct Next {
    MonotonicTime at;
    Step step;
  };
  // Returns the next step of a wait that started at `since`: kAsk if the peer was not asked since then, otherwise
  // `end`.
  Next NextOfWait(MonotonicTime since, const std::optional<MonotonicTime>& asked, Step end, Duration patience) const;
  Next FindNext(Duration patience) const;

  Options options_;
  bool is_heard_ = false;                         // True if the peer was heard since the link opened.
  MonotonicTime heard_{};                         // Last time the peer was heard or the link opened.
  std::optional<MonotonicTime> expecting_since_;  // Start of the current wait for reports of sent bytes.
  std::optional<MonotonicTime> blocked_since_;
  std::optional<MonotonicTime> asked_;  // Time of the last request, if the peer was not heard since.
  // Time of the first request while frames waited for credit, if the peer reported no progress since.
  std::optional<MonotonicTime> asked_as_blocked_;
};

}  // namespace moondb
