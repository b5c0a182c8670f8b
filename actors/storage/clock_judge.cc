#include "actors/storage/clock_judge.h"

#include <cmath>
#include <cstdio>
#include <utility>

namespace moondb {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::int64_t kTolerance_ns = 60 * kSecond_ns;
constexpr std::int64_t kUtcMin_ns = 1'704'067'200 * kSecond_ns;  // 2024-01-01.
// 2200-01-01. Differences of times below this bound cannot overflow.
constexpr std::int64_t kUtcMax_ns = 7'258'118'400 * kSecond_ns;

bool IsPlausible(std::int64_t utc_ns) { return utc_ns >= kUtcMin_ns && utc_ns < kUtcMax_ns; }

bool Agree(std::int64_t offset_a_ns, std::int64_t offset_b_ns) {
  return std::llabs(offset_a_ns - offset_b_ns) <= kTolerance_ns;
}

}  // namespace

bool IsSuspectTimestamp(std::int64_t timestamp_ns, std::int64_t utc_ns) {
  return timestamp_ns < kTimestampMin_ns ||
         timestamp_ns - std::chrono::nanoseconds(kTimestampAheadMax).count() > utc_ns;
}

void ClockJudge::ObservePeer(AgentId peer, std::int64_t utc_ns, Time now) {
  if (IsPlausible(utc_ns)) {
    peers_[peer] = {utc_ns - now.time_since_epoch().count(), now};
  } else {
    peers_.erase(peer);
  }
}

std::vector<ClockJudge::PeerOffset> ClockJudge::PeerOffsets(std::int64_t utc_ns, Time now) const {
  std::vector<PeerOffset> offsets;
  for (const auto& [agent, peer] : peers_) {
    // Computed in doubles, because this agent's own clock may show any value and an integer difference could overflow.
    const double offset_ns = static_cast<double>(peer.offset_ns) + static_cast<double>(now.time_since_epoch().count()) -
                             static_cast<double>(utc_ns);
    offsets.push_back({agent, offset_ns / kSecond_ns, std::chrono::duration<double>(now - peer.heard).count()});
  }
  return offsets;
}

ClockJudge::Verdict ClockJudge::Judge(std::int64_t utc_ns, Time now) {
  Verdict verdict;
  if (!IsPlausible(utc_ns)) {
    verdict.has_jumped = offset_ns_.has_value();
    offset_ns_.reset();
    unproven_jump_s_ = 0;
    was_never_set_ = true;
    verdict.suspect = "it was never set";
    return verdict;
  }
  verdict.has_jumped = std::exchange(was_never_set_, false);
  const std::int64_t offset_ns = utc_ns - now.time_since_epoch().count();
  if (offset_ns_ && !Agree(offset_ns, *offset_ns_)) {
    verdict.has_jumped = true;
    unproven_jump_s_ += static_cast<double>(offset_ns - *offset_ns_) / kSecond_ns;
  }
  offset_ns_ = offset_ns;

  int agreeing = 1;  // This agent's own clock.
  int differing = 0;
  for (const auto& [agent, peer] : peers_) {
    ++(Agree(offset_ns, peer.offset_ns) ? agreeing : differing);
  }
  const auto base = peers_.find(base_station_);
  const bool is_off_base = base != peers_.end() && !Agree(offset_ns, base->second.offset_ns);
  const bool is_off = differing > agreeing || (differing == agreeing && is_off_base);
  if (!is_off && agreeing > 1) unproven_jump_s_ = 0;
  if (is_off) {
    verdict.suspect = "it is more than a minute off the clocks of " + std::to_string(differing) + " other agents";
  } else if (std::abs(unproven_jump_s_) * kSecond_ns > kTolerance_ns) {
    char text[80];
    std::snprintf(text, sizeof(text), "it jumped by %.0f s, and no other agent's clock agrees", unproven_jump_s_);
    verdict.suspect = text;
  }
  return verdict;
}

}  // namespace moondb
