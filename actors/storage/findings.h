// Reads this agent's own events: how its previous process ended, and which findings no operator has acknowledged yet
// (model/event.h). Nothing is cached.
//
// Events are ordered by epoch and seq. This order also holds for events that a peer returned after this agent's disk
// was lost. The functions fail as Database does.
#pragma once

#include <cstdint>
#include <vector>

#include "actors/storage/sqlite_database.h"
#include "model/event.h"
#include "model/ids.h"

namespace moondb {

// Maximum number of newest events that one call reads. Reading this many takes about 60 ms.
inline constexpr std::int64_t kOwnEventsMax = 20'000;

// ReadOwnEvents returns the last `events_max` events of `self`, in the order in which it logged them. ReadFindings
// returns the findings of `self` that are open according to its last kOwnEventsMax events.
Result<std::vector<OwnEvent>> ReadOwnEvents(Database& database, AgentId self, std::int64_t events_max);
Result<std::vector<proto::HealthFinding>> ReadFindings(Database& database, AgentId self);

// Returns true if the last process of `self` that logged an event ended without EVENT_KIND_STOPPED, and no later
// process has reported this yet. Damage events are ignored, because a process logs them before its agent runs.
Result<bool> HasEndedWithoutStopping(Database& database, AgentId self);

}  // namespace moondb
