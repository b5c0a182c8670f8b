#include "apps/moonctl/map_questions.h"

#include "apps/common/json_writer.h"
#include "apps/common/proto_json.h"
#include "apps/common/table.h"
#include "apps/common/utc.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/node_name.h"
#include "apps/moonctl/quarantine.h"
#include "apps/moonctl/unplaced.h"
#include "model/record_key.h"
#include "model/text.h"

namespace moondb {
namespace {

struct Place {
  double x_m = 0;
  double y_m = 0;
};

std::string PlaceText(double x_m, double y_m) { return "(" + FormatFixed(x_m, 3) + ", " + FormatFixed(y_m, 3) + ")"; }

std::vector<std::string> ObservationRow(const proto::TeamConfig& team, const proto::MapObservation& said) {
  const std::string node = std::to_string(said.node().agent_id()) + ":" + std::to_string(said.node().index());
  const auto& at = said.map_from_node().position_m();
  const std::string pose = PlaceText(at.x(), at.y()) + (said.is_pose_optimized() ? ""
                                                        : said.is_pose_carried() ? " carried"
                                                                                 : " raw");
  const std::string remark = RemarkOn(said);
  if (said.is_footprint()) {
    return {CellValueName(said.value()), AgentName(team, said.node().agent_id()), "-", "-", "-", node, pose, remark};
  }
  return {CellValueName(said.value()),
          AgentName(team, said.record().origin_agent()),
          FormatUtc(said.timestamp_ns()),
          std::to_string(said.level()),
          FormatDouble(said.resolution_um() / 1e6),
          node,
          pose,
          ToString(FromProto(said.record())) + (remark.empty() ? "" : " " + remark)};
}

ExitCode RequestWhy(CommandContext& context, const Place& place) {
  auto target = context.ConnectToChosenOrLeader();
  if (!target) return context.Report(target.error());
  auto why = target->client->MapWhy(place.x_m, place.y_m);
  if (!why) return context.Report(why.error());
  const proto::TeamConfig& team = (*context.Team())->config;
  std::string text = "the cell at " + PlaceText(why->cell_x_m(), why->cell_y_m()) + " is " +
                     CellValueName(why->value()) + " at " + target->agent->name();
  if (why->observations().empty()) return context.Print(ExitCode::kDone, ToJson(*why), text + ": no map covers it");
  Table table({"SAYS", "AGENT", "TIME", "LEVEL", "CELL M", "NODE", "AT", "MAP"});
  for (const proto::MapObservation& said : why->observations()) table.Add(ObservationRow(team, said));
  text += "; in order of precedence, the winner first:\n" + table.Text();
  if (why->left_out_count() > 0) text += "and " + FormatCount(why->left_out_count()) + " more maps or footprints\n";
  return context.Print(ExitCode::kDone, ToJson(*why), text);
}

// Returns one end of a quarantine's time range, or "-" without such an end.
std::string SpanText(const proto::MapQuarantine& quarantine, std::int64_t timestamp_ns) {
  const bool is_of_maps = quarantine.graph_part_case() == proto::MapQuarantine::GRAPH_PART_NOT_SET;
  return !is_of_maps || timestamp_ns == INT64_MIN || timestamp_ns == INT64_MAX ? "-" : FormatUtc(timestamp_ns);
}

std::string QuarantinesText(const proto::TeamConfig& team, const proto::MapStatsReply& stats) {
  if (stats.quarantines().empty()) return "";
  Table table({"QUARANTINE", "AGENT", "EXCLUDES", "FROM", "TO", "MAPS", "REASON"});
  for (const proto::StandingQuarantine& standing : stats.quarantines()) {
    const proto::MapQuarantine& said = standing.quarantine();
    table.Add({ToString(FromProto(standing.record())), AgentName(team, said.agent_id()), QuarantinedText(team, said),
               SpanText(said, said.from_ns()), SpanText(said, said.to_ns()), FormatCount(standing.map_count()),
               said.reason()});
  }
  return table.Text();
}

std::string FarText(const proto::TeamConfig& team, const proto::MapStatsReply& stats) {
  std::string text;
  for (const proto::FarNode& far : stats.far_nodes()) {
    text += "node " + NodeName(team, FromProto(far.node())) + " lies " + FormatFixed(far.distance_m() / 1000, 0) +
            " km from the team and is excluded; after moonctl graph quarantine, the solver places it\n";
  }
  return text;
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
                           " in memory, merged on " + stats->backend() + "\n" +
                           UnplacedText(team, stats->frame_of(), stats->unplaced()) + CutText(team, stats->cut()) +
                           RefusedText(*stats) + FarText(team, *stats) + QuarantinesText(team, *stats);
  return context.Print(ExitCode::kDone, ToJson(*stats), text);
}

}  // namespace

const char* CellValueName(std::uint32_t value) {
  constexpr const char* kNames[] = {"unknown", "free", "hazard"};
  return value < std::size(kNames) ? kNames[value] : "damaged";
}

std::string RemarkOn(const proto::MapObservation& said) {
  if (said.is_footprint()) return "the rover stood there";
  std::string remark = said.is_quarantined() ? "quarantined" : "";
  if (said.is_clock_suspect()) remark += std::string(remark.empty() ? "" : ", ") + "clock suspect";
  return remark;
}

void AddMapQuestions(Command& group, CommandContext& context) {
  auto place = std::make_shared<Place>();
  Command& why = AddCommand(group, "why", "Show which maps decide a cell, at the leader (or -a)",
                            {"moonctl map why 10 -5.25", kShows});
  why.AddOption("x", place->x_m, "x in metres, in the frame map").Required();
  why.AddOption("y", place->y_m, "y in metres, in the frame map").Required();
  why.Callback([&context, place] { context.action = [&context, place] { return RequestWhy(context, *place); }; });

  Command& stats =
      AddCommand(group, "stats", "Show how many maps win cells, and the quarantines, at the leader (or -a)",
                 {"moonctl map stats", kShows});
  stats.Callback([&context] { context.action = [&context] { return ShowStats(context); }; });

  AddMapQuarantine(group, context);
}

}  // namespace moondb
