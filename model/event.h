// Events: entries of the event log, for people who investigate a problem later. Each event is one line of text. The
// agent that observes an event logs the event and shares it like any other record.
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

// Returns the display name: "started". Returns "unknown" for EVENT_KIND_UNSPECIFIED and unknown kinds.
std::string EventKindName(proto::EventKind kind);

// --- Findings: problems that need an operator, because nothing repairs them automatically ---

inline constexpr std::size_t kFindingsMax = 32;

// Text of the event of EVENT_KIND_DAMAGE of an agent whose disk lacks records of its own that other agents know.
inline constexpr char kDiskReplaced[] =
    "other agents know records of this agent that its disk does not have: the disk was replaced or restored; "
    "'moonctl sync now' returns what they hold, and records that no other agent holds are lost";
// Texts of events of EVENT_KIND_LOST. BackPeerText says that a lost peer has returned; in the findings, it replaces the
// LostPeerText of the same peer.
inline constexpr char kEndedWithoutStopping[] = "the previous process ended without a clean stop";
std::string LostPeerText(const std::string& peer);
std::string BackPeerText(const std::string& peer, double away_s);
// Returns whether the text of a finding says that this peer was lost and has not returned.
bool SaysLost(const std::string& text, const std::string& peer);

// AcknowledgedText returns the text of an event of EVENT_KIND_ACKNOWLEDGED: `count` findings with timestamps up to
// `until_ns` were acknowledged. AcknowledgedUntil returns `until_ns` from such a text; nullopt for another text.
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
// logged before it and whose timestamps are not later than the acknowledged timestamp. Findings about the same problem
// are merged into one finding, with the last timestamp and a count.
std::vector<proto::HealthFinding> FindingsOf(const std::vector<OwnEvent>& events);

}  // namespace moondb
