#include "apps/moonctl/map_questions.h"

#include "apps/common/json_writer.h"
#include "apps/common/proto_json.h"
#include "apps/common/table.h"
#include "apps/common/utc.h"
#include "apps/moonctl/command.h"
#include "model/record_key.h"
#include "model/text.h"

namespace moondb {
namespace {

constexpr std::int64_t kBeginning = INT64_MIN;
constexpr std::int64_t kEndOfTime = INT64_MAX;

struct Place {
  double x_m = 0;
  double y_m = 0;
};

struct QuarantineArguments {
  std::string agent;
  std::string from;
  std::string to;
  std::string reason;
  std::string lift;
};

const char* ValueName(std::uint32_t value) {
  constexpr const char* kNames[] = {"unknown", "free", "hazard"};
  return value < std::size(kNames) ? kNames[value] : "damaged";
}

std::string PlaceText(double x_m, double y_m) { return "(" + FormatFixed(x_m, 3) + ", " + FormatFixed(y_m, 3) + ")"; }

std::vector<std::string> ObservationRow(const proto::TeamConfig& team, const proto::MapObservation& said) {
  const std::string node = std::to_string(said.node().agent_id()) + ":" + std::to_string(said.node().index());
  const auto& at = said.map_from_node().position_m();
  const std::string pose = PlaceText(at.x(), at.y()) + (said.is_pose_optimized() ? "" : " raw");
  if (said.is_footprint()) {
    return {ValueName(said.value()), AgentName(team, said.node().agent_id()), "-", "-", "-", node, pose,
            "it stood there"};
  }
  std::string remark = said.is_quarantined() ? "quarantined" : "";
  if (said.is_clock_suspect()) remark += std::string(remark.empty() ? "" : ", ") + "clock suspect";
  return {ValueName(said.value()),
          AgentName(team, said.record().origin_agent()),
          FormatUtc(said.timestamp_ns()),
          std::to_string(said.level()),
          FormatDouble(said.resolution_um() / 1e6),
          node,
          pose,
          ToString(FromProto(said.record())) + (remark.empty() ? "" : " " + remark)};
}

ExitCode AskWhy(CommandContext& context, const Place& place) {
  auto target = context.ConnectToChosenOrLeader();
  if (!target) return context.Report(target.error());
  auto why = target->client->MapWhy(place.x_m, place.y_m);
  if (!why) return context.Report(why.error());
  const proto::TeamConfig& team = (*context.Team())->config;
  std::string text = "the cell at " + PlaceText(why->cell_x_m(), why->cell_y_m()) + " is " + ValueName(why->value()) +
                     " at " + target->agent->name();
  if (why->observations().empty()) return context.Print(ExitCode::kDone, ToJson(*why), text + ": no map knows it");
  Table table({"SAYS", "AGENT", "TIME", "LEVEL", "CELL M", "NODE", "AT", "MAP"});
  for (const proto::MapObservation& said : why->observations()) table.Add(ObservationRow(team, said));
  text += "; in order of precedence, the winner first:\n" + table.Text();
  if (why->left_out_count() > 0) text += "and " + FormatCount(why->left_out_count()) + " more\n";
  return context.Print(ExitCode::kDone, ToJson(*why), text);
}

std::string SpanText(std::int64_t timestamp_ns) {
  return timestamp_ns == kBeginning || timestamp_ns == kEndOfTime ? "-" : FormatUtc(timestamp_ns);
}

std::string QuarantinesText(const proto::TeamConfig& team, const proto::MapStatsReply& stats) {
  if (stats.quarantines().empty()) return "";
  Table table({"QUARANTINE", "MAPS OF", "FROM", "TO", "MAPS", "REASON"});
  for (const proto::StandingQuarantine& standing : stats.quarantines()) {
    const proto::MapQuarantine& said = standing.quarantine();
    table.Add({ToString(FromProto(standing.record())), AgentName(team, said.agent_id()), SpanText(said.from_ns()),
               SpanText(said.to_ns()), FormatCount(standing.map_count()), said.reason()});
  }
  return table.Text();
}

std::string RefusedText(const proto::MapStatsReply& stats) {
  if (stats.refused_map_count() == 0) return "";
  return FormatCount(stats.refused_map_count()) + " maps or footprints cannot be merged, see the agent's log\n";
}

ExitCode ShowStats(CommandContext& context) {
  auto target = context.ConnectToChosenOrLeader();
  if (!target) return context.Report(target.error());
  auto stats = target->client->MapStats();
  if (!stats) return context.Report(stats.error());
  const proto::TeamConfig& team = (*context.Team())->config;
  Table table({"AGENT", "MAPS", "WINNING", "WAITING", "QUARANTINED", "CELLS WON", "FOOTPRINT CELLS"});
  for (const proto::AgentMapStats& agent : stats->agents()) {
    table.Add({AgentName(team, agent.agent_id()), FormatCount(agent.map_count()),
               FormatCount(agent.winning_map_count()), FormatCount(agent.waiting_map_count()),
               FormatCount(agent.quarantined_map_count()), FormatCount(agent.won_cell_count()),
               FormatCount(agent.footprint_cell_count())});
  }
  const std::string text = table.Text() + target->agent->name() + ": " + FormatCount(stats->free_cell_count()) +
                           " free and " + FormatCount(stats->hazard_cell_count()) + " hazard cells of " +
                           FormatDouble(stats->resolution_um() / 1e6) + " m, " + FormatBytes(stats->memory_bytes()) +
                           " in memory, merged on " + stats->backend() + "\n" + RefusedText(*stats) +
                           QuarantinesText(team, *stats);
  return context.Print(ExitCode::kDone, ToJson(*stats), text);
}

Result<std::int64_t> TimestampOf(const std::string& text, std::int64_t missing, const char* option) {
  if (text.empty()) return missing;
  const auto time = ParseUtc(text);
  if (time) return std::chrono::duration_cast<std::chrono::nanoseconds>(time->time_since_epoch()).count();
  return Fail(ErrorCode::kInvalid, "expected a time in UTC such as 2026-11-22T06:00Z, got \"" + text + "\"", option);
}

Result<proto::Record> MakeQuarantine(CommandContext& context, const QuarantineArguments& arguments) {
  if (arguments.agent.empty() == arguments.lift.empty()) {
    return Fail(ErrorCode::kInvalid, "expected --agent NAME, or --lift ID of one that map stats shows");
  }
  proto::Record record;
  record.set_timestamp_ns(UtcNowNs());
  proto::MapQuarantine& quarantine = *record.mutable_map_quarantine();
  quarantine.set_reason(arguments.reason);
  if (!arguments.lift.empty()) {
    const Result<RecordKey> key = ParseRecordKey(arguments.lift);
    if (!key) return Fail(ErrorCode::kInvalid, key.error().text, "--lift");
    *quarantine.mutable_lifts() = ToProto(*key);
    return record;
  }
  auto team = context.Team();
  if (!team) return tl::unexpected(team.error());
  auto agent = AgentNamed((*team)->config, arguments.agent);
  if (!agent) return tl::unexpected(agent.error());
  const Result<std::int64_t> from = TimestampOf(arguments.from, kBeginning, "--from");
  if (!from) return tl::unexpected(from.error());
  const Result<std::int64_t> to = TimestampOf(arguments.to, kEndOfTime, "--to");
  if (!to) return tl::unexpected(to.error());
  if (*from > *to) return Fail(ErrorCode::kInvalid, "lies before --from", "--to");
  quarantine.set_agent_id((*agent)->id());
  quarantine.set_from_ns(*from);
  quarantine.set_to_ns(*to);
  return record;
}

// Returns kNotFound if `quarantine` lifts a quarantine that does not exist, for example because the operator mistyped
// its ID.
Result<void> CheckStands(Client& client, const proto::MapQuarantine& quarantine) {
  if (!quarantine.has_lifts()) return {};
  const auto stats = client.MapStats();
  if (!stats) return tl::unexpected(stats.error());
  for (const proto::StandingQuarantine& standing : stats->quarantines()) {
    if (FromProto(standing.record()) == FromProto(quarantine.lifts())) return {};
  }
  return Fail(ErrorCode::kNotFound, "no quarantine of that ID stands; moonctl map stats shows those that do", "--lift");
}

ExitCode SetQuarantine(CommandContext& context, const QuarantineArguments& arguments) {
  const auto record = MakeQuarantine(context, arguments);
  if (!record) return context.Report(record.error());
  auto target = context.ConnectToChosenOrLeader();
  if (!target) return context.Report(target.error());
  if (auto stands = CheckStands(*target->client, record->map_quarantine()); !stands) {
    return context.Report(stands.error());
  }
  auto keys = target->client->Insert({*record});
  if (!keys) return context.Report(keys.error());
  const std::string key = ToString(keys->front());
  JsonWriter json;
  json.BeginObject().Key("agent").String(target->agent->name()).Key("key").String(key).EndObject();
  auto roles = target->client->Roles();
  const bool is_leader = roles && roles->roles().leader() == target->agent->id();
  const std::string next = is_leader ? "moonctl sync now brings it to all others"
                                     : "moonctl sync now brings it to the leader, and again to all others";
  const std::string what = arguments.lift.empty() ? "quarantine " + key + " stands" : arguments.lift + " is lifted";
  return context.Done(json.text(), what + " at " + target->agent->name() + "; " + next);
}

}  // namespace

void AddMapQuestions(Command& group, CommandContext& context) {
  auto place = std::make_shared<Place>();
  Command& why = AddCommand(group, "why", "Show which maps decide a cell, at the leader (or -a)",
                            {"moonctl map why 10 -5.25", kShows});
  why.AddOption("x", place->x_m, "x in metres, in the frame map").Required();
  why.AddOption("y", place->y_m, "y in metres, in the frame map").Required();
  why.Callback([&context, place] { context.action = [&context, place] { return AskWhy(context, *place); }; });

  Command& stats = AddCommand(group, "stats", "Show which maps win cells, and quarantines, at the leader (or -a)",
                              {"moonctl map stats", kShows});
  stats.Callback([&context] { context.action = [&context] { return ShowStats(context); }; });

  auto arguments = std::make_shared<QuarantineArguments>();
  Command& quarantine =
      AddCommand(group, "quarantine", "Leave an agent's maps out of all merged maps",
                 {"moonctl map quarantine --agent rover2 --from 2026-11-21T10:00Z --reason \"wheel slip\""});
  quarantine.AddOption("--agent", arguments->agent, "Agent whose maps to leave out").TypeName("AGENT");
  quarantine.AddOption("--from", arguments->from, "Start of the time range in UTC: 2026-11-22T06:00Z").TypeName("TIME");
  quarantine.AddOption("--to", arguments->to, "End of the time range in UTC").TypeName("TIME");
  quarantine.AddOption("--reason", arguments->reason, "Reason, kept in the record");
  quarantine.AddOption("--lift", arguments->lift, "Undo the quarantine of that ID, which map stats shows")
      .TypeName("ID");
  quarantine.Callback(
      [&context, arguments] { context.action = [&context, arguments] { return SetQuarantine(context, *arguments); }; });
}

}  // namespace moondb
