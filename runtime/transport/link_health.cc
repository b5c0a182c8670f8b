#include "runtime/transport/link_health.h"

#include <algorithm>

namespace moondb {

void LinkHealth::OnOpened(MonotonicTime now) {
  is_heard_ = false;
  heard_ = now;
  expecting_since_.reset();
  blocked_since_.reset();
  asked_.reset();
  asked_as_blocked_.reset();
}

void LinkHealth::OnHeard(MonotonicTime now) {
  is_heard_ = true;
  heard_ = now;
  asked_.reset();
}

void LinkHealth::OnProgress(MonotonicTime now) {
  OnHeard(now);
  asked_as_blocked_.reset();
  if (blocked_since_) blocked_since_ = now;
}

void LinkHealth::Expect(MonotonicTime now, bool has_unreported, bool is_blocked) {
  if (!has_unreported) {
    expecting_since_.reset();
  } else if (!expecting_since_) {
    expecting_since_ = now;
  }
  if (!is_blocked) {
    blocked_since_.reset();
    asked_as_blocked_.reset();
  } else if (!blocked_since_) {
    blocked_since_ = now;
  }
}

LinkHealth::Next LinkHealth::NextOfWait(MonotonicTime since, const std::optional<MonotonicTime>& asked, Step end,
                                        Duration patience) const {
  if (!asked || *asked < since) return {since + options_.ask_after, Step::kAsk};
  // Give the peer its full time to answer, even if this agent sent its request late.
  const Duration lost_after = is_heard_ ? options_.lost_after : options_.first_answer_after;
  const MonotonicTime answered_by = *asked + lost_after - options_.ask_after;
  return {std::max(since + lost_after, answered_by) + patience, end};
}

LinkHealth::Next LinkHealth::FindNext(Duration patience) const {
  Next next{heard_ + options_.keep_alive_after, Step::kAsk};
  if (expecting_since_) {
    next = NextOfWait(std::max(heard_, *expecting_since_), asked_, Step::kLost, patience);
  } else if (asked_) {
    next = NextOfWait(*asked_, asked_, Step::kLost, patience);
  }
  if (!blocked_since_) return next;
  const Next stalled = NextOfWait(*blocked_since_, asked_as_blocked_, Step::kStalled, patience);
  return stalled.at < next.at ? stalled : next;
}

LinkHealth::Step LinkHealth::Check(MonotonicTime now, Duration patience) {
  const Next next = FindNext(patience);
  if (now < next.at) return Step::kNone;
  if (next.step == Step::kAsk) {
    asked_ = now;
    if (blocked_since_ && !asked_as_blocked_) asked_as_blocked_ = now;
  }
  return next.step;
}

MonotonicTime LinkHealth::deadline(Duration patience) const { return FindNext(patience).at; }

}  // namespace moondb
