// Events: one line each of what people will ask about later, logged by the agent that saw it and shared like any
// record.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/record.pb.h"

namespace moondb::proto {
class HealthFinding;
}  // namespace moondb::proto

namespace moondb {

inline constexpr std::size_t kEventTextBytesMax = 512;
inline constexpr std::size_t kEventByBytesMax = 64;

// Texts become one line of UTF-8 and are cut to the limits.
proto::Record MakeEvent(proto::EventKind kind, std::string_view text, std::string_view by, std::int64_t timestamp_ns);

// "started": as people and scripts read it.
std::string EventKindName(proto::EventKind kind);

// --- Findings: what an operator must hear of, and nothing mends by itself ---

inline constexpr std::size_t kFindingsMax = 32;

// Of EVENT_KIND_LOST. A peer's event of its return takes the place of that of its loss.
inline constexpr char kEndedWithoutStopping[] = "the process before ended without stopping";
std::string LostPeerText(const std::string& peer);
std::string BackPeerText(const std::string& peer, double away_s);
// Whether a finding says that this peer was lost and is not back.
bool SaysLost(const std::string& text, const std::string& peer);

// Of EVENT_KIND_ACKNOWLEDGED: findings up to that stamp, the number of which is for people. And that stamp again.
std::string AcknowledgedText(std::int64_t until_ns, std::size_t count);
std::optional<std::int64_t> AcknowledgedUntil(const std::string& text);

// One of an agent's own.
struct OwnEvent {
  std::int64_t timestamp_ns = 0;
  proto::EventKind kind = proto::EVENT_KIND_UNSPECIFIED;
  std::string text;
};

// What nobody has acknowledged, oldest first, of an agent's events in the order in which it wrote them down. An
// acknowledgment is of what was written down before it, with a stamp up to its own, so that a clock that was ahead once
// hides nothing later. What happened several times stands once, with the last stamp and how often. Of more than
// kFindingsMax the newest.
std::vector<proto::HealthFinding> FindingsOf(const std::vector<OwnEvent>& events);

}  // namespace moondb
