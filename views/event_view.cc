#include "views/event_view.h"

#include "model/event.h"

namespace moondb {
namespace {

Severity SeverityOf(proto::EventKind kind) {
  switch (kind) {
    case proto::EVENT_KIND_DAMAGE:
      return Severity::kError;
    case proto::EVENT_KIND_RESTART:
    case proto::EVENT_KIND_REJECTED:
    case proto::EVENT_KIND_LOST:
      return Severity::kWarning;
    default:
      return Severity::kInfo;
  }
}

}  // namespace

EventView EventViewOf(const RecordKey& key, const proto::Record& record) {
  const proto::AgentEvent& event = record.agent_event();
  return {record.timestamp_ns(),       key.stream.origin, SeverityOf(event.kind()),
          EventKindName(event.kind()), event.text(),      event.by()};
}

}  // namespace moondb
