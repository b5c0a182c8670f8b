// Events: entries of the event log, for people who investigate a problem later. Each is one line. The agent that
// observes an event logs it and shares it like any record.
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

// Returns an event record. The texts become one line of UTF-8 and are cut to the limits.
proto::Record MakeEvent(proto::EventKind kind, std::string_view text, std::string_view by, std::int64_t timestamp_ns);

// Returns the name for people and scripts: "started".
std::string EventKindName(proto::EventKind kind);

// --- Findings: problems that need an operator, because nothing repairs them automatically ---

inline constexpr std::size_t kFindingsMax = 32;

// Texts of events of EVENT_KIND_LOST. In the findings, the event that a peer has returned replaces the event that the
// peer was lost.
inline constexpr char kEndedWithoutStopping[] = "the process before ended without stopping";
std::string LostPeerText(const std::string& peer);
std::string BackPeerText(const std::string& peer, double away_s);
// Returns whether the text of a finding says that this peer was lost and has not returned.
bool SaysLost(const std::string& text, const std::string& peer);

// AcknowledgedText returns the text of an EVENT_KIND_ACKNOWLEDGED: findings up to a timestamp are acknowledged. `count`
// is only for people. AcknowledgedUntil parses the timestamp from such a text; nullopt for another text.
std::string AcknowledgedText(std::int64_t until_ns, std::size_t count);
std::optional<std::int64_t> AcknowledgedUntil(const std::string& text);

// An event that an agent logged itself.
struct OwnEvent {
  std::int64_t timestamp_ns = 0;
  proto::EventKind kind = proto::EVENT_KIND_UNSPECIFIED;
  std::string text;
};

// Returns the unacknowledged findings, oldest first; only the newest kFindingsMax if there are more. Requires: `events`
// are an agent's events in the order in which it logged them. An acknowledgment applies only to findings that were
// logged before it and whose timestamps are not later than the acknowledged timestamp. A clock that was once ahead thus
// hides no later finding. Repeated findings are merged into one, with the last timestamp and a count.
std::vector<proto::HealthFinding> FindingsOf(const std::vector<OwnEvent>& events);

}  // namespace moondb
