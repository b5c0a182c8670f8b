// What an agent's own events say of it: how its process before this one ended, and what no operator has acknowledged
// yet (model/event.h). Asked of the table each time: nothing else remembers it, so it is the same after every restart.
//
// Events of an agent have an order of their own, epoch and seq, whenever they came home from which peer. Errors as
// Database's.
#pragma once

#include <cstdint>
#include <vector>

#include "actors/storage/sqlite_database.h"
#include "model/event.h"
#include "model/ids.h"

namespace moondb {

inline constexpr std::int64_t kOwnEventsMax = 20'000;  // So many, the newest, are looked at: some 60 ms.

// In the order in which `self` wrote them down: the last `events_max`, or of these those of which findings are made.
Result<std::vector<OwnEvent>> ReadOwnEvents(Database& database, AgentId self, std::int64_t events_max);
Result<std::vector<proto::HealthFinding>> ReadFindings(Database& database, AgentId self);

// Whether a process of `self` wrote something down and then ended without EVENT_KIND_STOPPED as its last event, and no
// start since then has said so. What only a start writes down before its agent runs (damage) is no process's.
Result<bool> HasEndedWithoutStopping(Database& database, AgentId self);

}  // namespace moondb
