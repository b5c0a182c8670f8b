// Reads this agent's own events: how its previous process ended, and which findings no operator has acknowledged yet
// (model/event.h). Each call reads the table of events; nothing is cached, so a restart changes no result.
//
// The events of one agent are ordered by epoch and seq, even if a peer returned some of them after a lost disk. Errors
// as for Database.
#pragma once

#include <cstdint>
#include <vector>

#include "actors/storage/sqlite_database.h"
#include "model/event.h"
#include "model/ids.h"

namespace moondb {

// Number of newest events that one call reads; this takes about 60 ms.
inline constexpr std::int64_t kOwnEventsMax = 20'000;

// ReadOwnEvents returns the last `events_max` events of `self`, in the order in which it logged them. ReadFindings
// returns the findings that are still open after its last kOwnEventsMax events.
Result<std::vector<OwnEvent>> ReadOwnEvents(Database& database, AgentId self, std::int64_t events_max);
Result<std::vector<proto::HealthFinding>> ReadFindings(Database& database, AgentId self);

// Returns true if the last process of `self` that logged an event ended without EVENT_KIND_STOPPED, and no later
// process has reported this yet. Damage events are ignored, because a process logs them before its agent runs.
Result<bool> HasEndedWithoutStopping(Database& database, AgentId self);

}  // namespace moondb
