// EventView: an entry of the event log, for programs that show or export events. Thread-safe.
#pragma once

#include <cstdint>
#include <string>

#include "model/record_key.h"
#include "proto/record.pb.h"

namespace moondb {

enum class Severity { kInfo, kWarning, kError };

struct EventView {
  std::int64_t timestamp_ns = 0;  // ns since 1970 UTC, by the agent's clock.
  AgentId agent = 0;              // The agent that logged the event.
  Severity severity = Severity::kInfo;
  std::string kind;  // EventKindName.
  std::string text;
  std::string by;  // The operator who gave the command: "anna@hill". Empty for other events.

  std::string TextBy() const { return by.empty() ? text : text + " (" + by + ")"; }
};

// Requires: the record is an event.
EventView EventViewOf(const RecordKey& key, const proto::Record& record);

}  // namespace moondb
