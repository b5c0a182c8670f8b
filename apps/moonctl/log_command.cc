#include <algorithm>

#include "apps/common/json_writer.h"
#include "apps/common/table.h"
#include "apps/common/utc.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/follow.h"
#include "apps/moonctl/time_span_option.h"
#include "model/event.h"
#include "model/text.h"
#include "proto/types.pb.h"
#include "views/event_view.h"

namespace moondb {
namespace {

constexpr std::uint32_t kEventsMax = 1000;

struct LogArguments {
  std::uint32_t events = 50;
  std::string origin;
  bool follows = false;
  TimeSpanArguments times;
};

struct LoggedEvent {
  // Row of the event in the connected agent's store. Rows are numbered in the order of storing.
  std::uint64_t row_id = 0;
  EventView event;
  bool is_clock_suspect = false;
};

LoggedEvent LoggedEventOf(std::uint64_t row_id, const proto::StoredRecord& stored, const proto::Record& record) {
  return {row_id, EventViewOf(FromProto(stored.key()), record), record.is_clock_suspect()};
}

Result<std::vector<LoggedEvent>> EventsOf(const proto::ReadReply& page) {
  std::vector<LoggedEvent> events;
  for (int i = 0; i < page.records_size() && i < page.row_ids_size(); ++i) {
    proto::Record record;
    if (!record.ParseFromString(page.records(i).content())) {
      return Fail(ErrorCode::kCorrupt, "an event cannot be decoded");
    }
    events.push_back(LoggedEventOf(page.row_ids(i), page.records(i), record));
  }
  return events;
}

std::vector<std::string> RowOf(const proto::TeamConfig& team, const EventView& event) {
  return {FormatUtc(event.timestamp_ns), AgentName(team, event.agent), event.kind, OneLine(event.TextBy(), 1024)};
}

std::string JsonOf(const proto::TeamConfig& team, const LoggedEvent& logged) {
  const EventView& event = logged.event;
  JsonWriter json;
  json.BeginObject().Key("utc").String(FormatUtc(event.timestamp_ns));
  json.Key("agent").String(AgentName(team, event.agent)).Key("kind").String(event.kind);
  json.Key("text").String(event.text).Key("by").String(event.by);
  json.Key("is_clock_suspect").Bool(logged.is_clock_suspect).EndObject();
  return json.text();
}

std::string LineOf(const proto::TeamConfig& team, const EventView& event) {
  std::string line;
  for (const std::string& cell : RowOf(team, event)) line += (line.empty() ? "" : "  ") + cell;
  return line;
}

// Prints the events that the agent stores after `after_row_id`.
ExitCode Follow(CommandContext& context, Client& client, proto::ReadRequest request, std::uint64_t after_row_id) {
  const proto::TeamConfig& team = (*context.Team())->config;
  request.set_after_row_id(after_row_id);
  return FollowRecords(context, client, std::move(request),
                       [&](const proto::StoredRecord& stored, const proto::Record& record) {
                         const LoggedEvent logged = LoggedEventOf(0, stored, record);
                         return context.is_json ? JsonOf(team, logged) : LineOf(team, logged.event);
                       });
}

ExitCode ShowLog(CommandContext& context, const LogArguments& arguments) {
  auto team = context.Team();
  if (!team) return context.Report(team.error());
  proto::ReadRequest request;
  request.add_data_types(proto::AGENT_EVENT);
  request.set_is_newest_first(true);
  request.set_records_max(arguments.events);
  if (!arguments.origin.empty()) {
    auto origin = AgentNamed((*team)->config, arguments.origin);
    if (!origin) return context.Report(origin.error());
    request.add_origin_agents((*origin)->id());
  }
  if (const auto set = SetTimes(arguments.times, UtcNowNs(), request); !set) return context.Report(set.error());
  auto target = context.ConnectToChosenOrLeader();
  if (!target) return context.Report(target.error());
  const auto page = target->client->Read(request);
  if (!page) return context.Report(page.error());
  auto events = EventsOf(*page);
  if (!events) return context.Report(events.error());
  std::uint64_t last_row_id = 0;
  for (const LoggedEvent& event : *events) last_row_id = std::max(last_row_id, event.row_id);
  // Sort by timestamp, because events may arrive late from other agents.
  std::stable_sort(events->begin(), events->end(), [](const LoggedEvent& a, const LoggedEvent& b) {
    return std::pair(a.event.timestamp_ns, a.row_id) < std::pair(b.event.timestamp_ns, b.row_id);
  });

  Table table({"TIME", "AGENT", "EVENT", "WHAT"});
  for (const LoggedEvent& logged : *events) table.Add(RowOf((*team)->config, logged.event));
  if (!arguments.follows) {
    JsonWriter json;
    json.BeginObject().Key("agent").String(target->agent->name()).Key("events").BeginArray();
    for (const LoggedEvent& event : *events) json.Raw(JsonOf((*team)->config, event));
    const bool is_cut = !page->is_complete() && events->size() < arguments.events;
    return context.Done(json.EndArray().EndObject().text(),
                        table.Text() + (is_cut ? "older events did not fit into the answer\n" : ""));
  }
  std::string json;  // One document per line.
  for (const LoggedEvent& event : *events) json += (json.empty() ? "" : "\n") + JsonOf((*team)->config, event);
  if (const ExitCode shown = context.Done(json, table.Text()); shown != ExitCode::kDone) return shown;
  return Follow(context, *target->client, std::move(request), last_row_id);
}

}  // namespace

void AddLogCommand(Command& app, CommandContext& context) {
  auto arguments = std::make_shared<LogArguments>();
  Command& log = AddCommand(app, "log", "Show the team's event log at the leader (or -a): commands, roles, failures",
                            {"moonctl log --events 20", kShows});
  log.AddOption("--events", arguments->events, "Number of newest events to show (50)").Within(1u, kEventsMax);
  log.AddOption("--origin", arguments->origin, "Show only events of this agent").TypeName("AGENT");
  Option& follow =
      log.AddFlag("-f,--follow", arguments->follows, "Keep printing new events; with --json one document per line");
  AddTimeSpanOptions(log, arguments->times, follow);
  log.Callback(
      [&context, arguments] { context.action = [&context, arguments] { return ShowLog(context, *arguments); }; });
}

}  // namespace moondb
