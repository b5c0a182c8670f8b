#include "model/event.h"

#include <algorithm>
#include <cctype>

#include "model/text.h"

namespace moondb {

namespace {

// OneLine marks what it cuts off, which takes some bytes more than it is told.
std::string Cut(std::string_view text, std::size_t bytes_max) { return OneLine(text, bytes_max - 8); }

}  // namespace

proto::Record MakeEvent(proto::EventKind kind, std::string_view text, std::string_view by, std::int64_t stamp_ns) {
  proto::Record record;
  record.set_stamp_ns(stamp_ns);
  proto::AgentEvent& event = *record.mutable_agent_event();
  event.set_kind(kind);
  event.set_text(Cut(text, kEventTextBytesMax));
  event.set_by(Cut(by, kEventByBytesMax));
  return record;
}

std::string EventKindName(proto::EventKind kind) {
  constexpr std::string_view kPrefix = "EVENT_KIND_";
  if (kind == proto::EVENT_KIND_UNSPECIFIED || !proto::EventKind_IsValid(kind)) return "unknown";
  std::string name = proto::EventKind_Name(kind).substr(kPrefix.size());
  std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
  return name;
}

}  // namespace moondb
