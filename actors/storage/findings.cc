#include "actors/storage/findings.h"

#include <algorithm>
#include <string>

#include "proto/status.pb.h"

namespace moondb {

namespace {

// Number of newest events to read: enough to skip the damage events of failed starts.
constexpr std::int64_t kLastEventsMax = 64;

// Appends events of `self` to `events`, newest first. `epochs` is an SQL comparison such as "< 0" for the epoch;
// `kinds` is an SQL clause that filters the kinds. SQLite stores epochs as signed numbers, so the highest epochs are
// negative there.
Result<void> AppendEvents(Database& database, const char* epochs, AgentId self, std::int64_t events_max,
                          const std::string& kinds, std::vector<OwnEvent>& events) {
  Query query = database.Prepare(
      "SELECT timestamp_ns, kind, text FROM (SELECT epoch, seq, timestamp_ns, kind, text FROM agent_event WHERE origin "
      "= ? AND "
      "epoch " +
      std::string(epochs) + " ORDER BY epoch DESC, seq DESC LIMIT ?)" + kinds + " ORDER BY epoch DESC, seq DESC");
  query << self << events_max;
  while (true) {
    const Result<bool> row = query.Step();
    if (!row) return tl::unexpected(row.error());
    if (!*row) return {};
    events.push_back({query.Integer(0), static_cast<proto::EventKind>(query.Integer(1)), std::string(query.Bytes(2))});
  }
}

Result<std::vector<OwnEvent>> ReadEvents(Database& database, AgentId self, std::int64_t events_max,
                                         const std::string& kinds) {
  std::vector<OwnEvent> events;
  for (const char* epochs : {"< 0", ">= 0"}) {
    const Result<void> done = AppendEvents(database, epochs, self, events_max, kinds, events);
    if (!done) return tl::unexpected(done.error());
  }
  std::reverse(events.begin(), events.end());
  return events;
}

}  // namespace

Result<std::vector<OwnEvent>> ReadOwnEvents(Database& database, AgentId self, std::int64_t events_max) {
  return ReadEvents(database, self, events_max, "");
}

Result<std::vector<proto::HealthFinding>> ReadFindings(Database& database, AgentId self) {
  const std::string kinds = " WHERE kind IN (" + std::to_string(proto::EVENT_KIND_DAMAGE) + ", " +
                            std::to_string(proto::EVENT_KIND_LOST) + ", " +
                            std::to_string(proto::EVENT_KIND_ACKNOWLEDGED) + ")";
  const Result<std::vector<OwnEvent>> events = ReadEvents(database, self, kOwnEventsMax, kinds);
  if (!events) return tl::unexpected(events.error());
  return FindingsOf(*events);
}

Result<bool> HasEndedWithoutStopping(Database& database, AgentId self) {
  const Result<std::vector<OwnEvent>> events = ReadOwnEvents(database, self, kLastEventsMax);
  if (!events) return tl::unexpected(events.error());
  const auto last = std::find_if(events->rbegin(), events->rend(),
                                 [](const OwnEvent& event) { return event.kind != proto::EVENT_KIND_DAMAGE; });
  if (last == events->rend() || last->kind == proto::EVENT_KIND_STOPPED) return false;
  return last->kind != proto::EVENT_KIND_LOST || last->text != kEndedWithoutStopping;
}

}  // namespace moondb
