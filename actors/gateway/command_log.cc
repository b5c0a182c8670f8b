#include "actors/gateway/command_log.h"

#include <utility>

#include "model/event.h"

namespace moondb {
CommandLog::Added CommandLog::Add(Kind kind, const std::string& text, const std::string& by, std::int64_t utc_now_ns) {
  Commands& commands = commands_[kind];
  if (commands.written >= options_.commands_max) {
    ++commands.left_out;
    commands.last_text = text;
    commands.last_by = by;
    return {};
  }
  return {MakeEvent(options_.event_kind, text, by, utc_now_ns), commands.written++ == 0};
}

std::optional<proto::Record> CommandLog::OnPeriodEnd(Kind kind, std::int64_t utc_now_ns) {
  const Commands commands = std::exchange(commands_[kind], {});
  if (commands.left_out == 0) return std::nullopt;
  const std::string text = commands.last_text + ": the last of " + std::to_string(commands.left_out) + " more commands";
  return MakeEvent(options_.event_kind, text, commands.last_by, utc_now_ns);
}

std::string ByOf(const proto::Message& message, const proto::ControlRequest& request) {
  constexpr char kByKey[] = "(key)";
  if (!message.client_name().empty()) return message.client_name() + " " + kByKey;
  std::string by = request.by();
  const std::size_t claim = by.find(kByKey);
  if (claim == std::string::npos) return by;
  by.resize(claim);
  while (by.ends_with(' ')) by.pop_back();
  return by;
}

}  // namespace moondb
