#include <algorithm>
#include <cmath>
#include <tuple>

#include "apps/common/graph_reading.h"
#include "apps/common/json_writer.h"
#include "apps/common/proto_json.h"
#include "apps/common/table.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/graph_commands.h"
#include "apps/moonctl/match_list.h"
#include "apps/moonctl/node_name.h"
#include "apps/moonctl/quarantine.h"
#include "apps/moonctl/refused_sets.h"
#include "apps/moonctl/rover_places.h"
#include "model/text.h"

namespace moondb {
namespace {

struct OptimizeArguments {
  bool is_from_scratch = false;
  std::uint32_t window_nodes = 0;
  bool has_covariance = false;
  std::vector<std::string> covariance_of;  // Names of nodes, such as "rover2:17".
};

std::string AnchoringText(proto::Anchoring anchoring) {
  switch (anchoring) {
    case proto::ANCHORING_ANCHORED:
      return "yes";
    case proto::ANCHORING_NO_RANGES:
      return "start only";
    case proto::ANCHORING_YAW_FREE:
      return "yaw free";
    case proto::ANCHORING_AMBIGUOUS:
      return "ambiguous";
    default:
      return "no";
  }
}

// Returns the standard deviation of one coordinate of a pose as text, or "-" without a valid covariance. Coordinates 0
// to 2 are the position, 3 to 5 the rotation.
std::string SigmaText(const proto::NodeCovariance& node, int coordinate, const char* unit) {
  const auto covariance = FromUpperTriangle(node.covariance());
  if (!covariance) return "-";
  return FormatFixed(std::sqrt((*covariance)(coordinate, coordinate)), 3) + " " + unit;
}

std::string CountText(double count, double rejected, const std::string& noun) {
  return FormatCount(count, noun) + " (" + FormatCount(rejected) + " rejected)";
}

std::string RefusedText(const proto::TeamConfig& team, const proto::RefusedSet& set) {
  std::string text = "refused " + RefusedCount(set);
  if (set.producer() != 0) text += " that " + AgentName(team, set.producer()) + " inserted";
  if (set.agent_ids_size() == 2) {
    text += " between " + AgentName(team, set.agent_ids(0)) + " and " + AgentName(team, set.agent_ids(1));
  } else if (set.agent_ids_size() == 1) {
    text += (set.is_prior() ? " on " : " within ") + AgentName(team, set.agent_ids(0));
  }
  return text + ": together they contradict the other measurements";
}

std::string SolveText(const proto::TeamConfig& team, const proto::OptimizeReply& solve) {
  if (IsError(solve.error())) return "the solve failed: " + FromProto(solve.error()).text + "\n";
  std::string text =
      FormatCount(solve.node_count(), "node") + ", " + FormatCount(solve.odometry_count(), "odometry edge") + ", " +
      CountText(solve.range_count(), solve.rejected_range_count(), "range") +
      (solve.closure_count() > 0
           ? ", " + CountText(solve.closure_count(), solve.rejected_closure_count(), "loop closure")
           : "") +
      (solve.prior_count() > 0 ? ", " + CountText(solve.prior_count(), solve.rejected_prior_count(), "prior") : "") +
      "\ncost " + FormatFixed(solve.initial_cost(), 2) + " to " + FormatFixed(solve.final_cost(), 2) + " in " +
      FormatCount(solve.iterations(), "iteration") + ", " + FormatFixed(solve.seconds(), 3) +
      " s, started from: " + solve.initial_values() + "; poses written: " + FormatCount(solve.updated_pose_count()) +
      "\n";
  if (!solve.text().empty()) text += solve.text() + "\n";
  for (const proto::RefusedSet& set : solve.refused_sets()) text += RefusedText(team, set) + "\n";
  for (const proto::FarNode& far : solve.far_nodes()) {
    text += "node " + NodeName(team, FromProto(far.node())) + " lies " + FormatFixed(far.distance_m() / 1000, 0) +
            " km from the team: check that its pose is in metres; after moonctl graph quarantine, the solver places "
            "the node\n";
  }
  Table table({"ROVER", "NODES", "ANCHORED", "ODOMETRY SCALE", "NOTE"});
  for (const proto::RoverSolution& rover : solve.rovers()) {
    table.Add({AgentName(team, rover.agent_id()), FormatCount(rover.node_count()), AnchoringText(rover.anchoring()),
               FormatFixed(rover.odometry_scale(), 4), rover.text()});
  }
  text += table.Text();
  if (solve.covariances().empty()) return text;
  Table spreads({"NODE", "X", "Y", "Z", "YAW"});
  for (const proto::NodeCovariance& node : solve.covariances()) {
    spreads.Add({NodeName(team, FromProto(node.node())), SigmaText(node, 0, "m"), SigmaText(node, 1, "m"),
                 SigmaText(node, 2, "m"), SigmaText(node, 5, "rad")});
  }
  return text + "one sigma:\n" + spreads.Text();
}

ExitCode OptimizeGraph(CommandContext& context, const OptimizeArguments& arguments) {
  const auto team = context.Team();
  if (!team) return context.Report(team.error());
  proto::OptimizeRequest request;
  request.set_from_scratch(arguments.is_from_scratch);
  request.set_window_nodes(arguments.window_nodes);
  request.set_with_covariance(arguments.has_covariance);
  for (const std::string& text : arguments.covariance_of) {
    const auto node = ParseNodeName((*team)->config, text, "--covariance-of");
    if (!node) return context.Report(node.error());
    *request.add_covariance_of() = ToProto(*node);
  }
  auto target = context.ConnectToChosenOrLeader();
  if (!target) return context.Report(target.error());
  auto solve = target->client->Optimize(request);
  if (!solve) return context.Report(solve.error());
  std::string text = SolveText((*team)->config, *solve);
  // Only the leader matches maps.
  const auto matching = target->client->Registration({});
  if (const std::string left = matching ? MatchingLeftText(*matching) : ""; !left.empty()) {
    text += left + ", and a solve follows; wait for both: moonctl graph matches --wait 5m\n";
  }
  return context.Done(ToJson(*solve), text);
}

// Statistics of the factors of one kind and source between two agents. A factor counts as rejected if its newest
// verdict rejects it.
struct GroupStats {
  std::size_t count = 0;
  std::size_t rejected_count = 0;
  std::size_t unjudged_count = 0;  // Loop closures and priors without a verdict: no solve has used them yet.
  double worst_sigmas = 0;         // Residual with the largest magnitude among the rejected factors, in sigmas.
};

// A kind, two agents (the smaller id first; both are equal within one rover) and a source.
using GroupKey = std::tuple<FactorKind, std::pair<AgentId, AgentId>, std::string>;

struct RejectedFactor {
  FactorKey key;
  const RangeEdge* range = nullptr;  // Null for other kinds.
  double residual_sigmas = 0;
};

struct FactorStats {
  std::map<GroupKey, GroupStats> groups;
  std::vector<RejectedFactor> rejected;
};

// Returns the statistics of all ranges, loop closures and priors in `graph`, with the verdicts in `known`. The result
// points into `graph`.
FactorStats FindFactorStats(const PoseGraph& graph, const KnownGraph& known) {
  FactorStats stats;
  const auto add = [&](const FactorKey& key, const RangeEdge* range) {
    GroupStats& group = stats.groups[{key.kind, std::minmax(key.from.agent, key.to.agent), key.source}];
    ++group.count;
    const PublishedVerdict* verdict = known.FindVerdict(key);
    if (verdict == nullptr && key.kind != FactorKind::kRange) ++group.unjudged_count;
    if (verdict == nullptr || verdict->is_inlier) return;
    stats.rejected.push_back({key, range, verdict->residual_sigmas});
    ++group.rejected_count;
    if (std::abs(verdict->residual_sigmas) > std::abs(group.worst_sigmas)) {
      group.worst_sigmas = verdict->residual_sigmas;
    }
  };
  for (const RangeEdge& range : graph.ranges) add(KeyOf(range), &range);
  for (const LoopClosure& closure : graph.closures) add(KeyOf(closure), nullptr);
  for (const NodePrior& prior : graph.priors) add(KeyOf(prior), nullptr);
  return stats;
}

std::string GroupsText(const proto::TeamConfig& team, const FactorStats& stats) {
  if (stats.groups.empty()) return "this agent holds no range, loop closure or prior\n";
  Table table({"KIND", "BETWEEN", "", "SOURCE", "HELD", "REJECTED", "NOT JUDGED", "WORST SIGMAS"});
  for (const auto& [key, group] : stats.groups) {
    const auto& [kind, agents, source] = key;
    table.Add({ToString(kind), AgentName(team, agents.first),
               kind == FactorKind::kPrior ? "-" : AgentName(team, agents.second), source.empty() ? "-" : source,
               std::to_string(group.count), std::to_string(group.rejected_count), std::to_string(group.unjudged_count),
               group.rejected_count == 0 ? "-" : FormatFixed(group.worst_sigmas, 1)});
  }
  return table.Text();
}

std::string RejectedText(const proto::TeamConfig& team, const std::vector<RejectedFactor>& rejected) {
  Table table({"REJECTED", "FROM", "TO", "SOURCE", "RANGE m", "SIGMAS"});
  for (const auto& [key, range, residual_sigmas] : rejected) {
    table.Add({ToString(key.kind), NodeName(team, key.from),
               key.kind == FactorKind::kPrior ? "-" : NodeName(team, key.to), key.source.empty() ? "-" : key.source,
               range == nullptr ? "-" : FormatFixed(range->range_m, 3), FormatFixed(residual_sigmas, 1)});
  }
  return table.Text();
}

void WriteFactors(const proto::TeamConfig& team, const FactorStats& stats, JsonWriter& json) {
  json.Key("factors").BeginArray();
  for (const auto& [key, group] : stats.groups) {
    const auto& [kind, agents, source] = key;
    json.BeginObject()
        .Key("kind")
        .String(ToString(kind))
        .Key("agents")
        .BeginArray()
        .String(AgentName(team, agents.first));
    if (kind != FactorKind::kPrior) json.String(AgentName(team, agents.second));
    json.EndArray().Key("source").String(source);
    json.Key("held").Number(static_cast<double>(group.count));
    json.Key("rejected").Number(static_cast<double>(group.rejected_count));
    json.Key("not_judged").Number(static_cast<double>(group.unjudged_count));
    json.Key("worst_sigmas").Number(group.worst_sigmas).EndObject();
  }
  json.EndArray().Key("rejected").BeginArray();
  for (const auto& [key, range, residual_sigmas] : stats.rejected) {
    json.BeginObject().Key("kind").String(ToString(key.kind));
    json.Key("from").Raw(ToJson(ToProto(key.from))).Key("to").Raw(ToJson(ToProto(key.to)));
    json.Key("source").String(key.source);
    if (range != nullptr) json.Key("range_m").Number(range->range_m);
    json.Key("residual_sigmas").Number(residual_sigmas).EndObject();
  }
  json.EndArray();
}

ExitCode ShowGraphStats(CommandContext& context, bool has_edges) {
  auto target = context.ConnectToChosenOrLeader();
  if (!target) return context.Report(target.error());
  const proto::TeamConfig& team = (*context.Team())->config;
  auto stats = target->client->GraphStats();
  if (!stats) return context.Report(stats.error());
  const auto known = ReadGraphOf(*target->client, team);
  if (!known) return context.Report(known.error());
  std::string text = stats->solve_count() == 0
                         ? target->agent->name() + " has not solved the graph since it started\n"
                         : "solves since the agent started: " + FormatCount(stats->solve_count()) +
                               "; the last one:\n" + SolveText(team, stats->last_solve());
  // Only the leader matches maps.
  const auto registration = target->client->Registration({});
  if (registration) text += PlacesText(team, *registration);
  const PoseGraph graph = known->graph();
  const FactorStats factors = FindFactorStats(graph, *known);
  text += GroupsText(team, factors);
  if (known->quarantines().size() > 0) {
    text += std::to_string(known->quarantines().size()) +
            (known->quarantines().size() == 1 ? " quarantine excludes" : " quarantines exclude") +
            " parts of the graph; moonctl map stats lists them\n";
  }
  if (has_edges) text += RejectedText(team, factors.rejected);
  JsonWriter json;
  json.BeginObject().Key("solve_count").Number(stats->solve_count());
  json.Key("last_solve").Raw(ToJson(stats->last_solve()));
  json.Key("starts").BeginArray();
  if (registration) {
    for (const proto::SearchedStart& start : registration->starts()) json.Raw(ToJson(start));
  }
  json.EndArray();
  WriteFactors(team, factors, json);
  json.EndObject();
  return context.Done(json.text(), text);
}

}  // namespace

void AddGraphCommands(Command& app, CommandContext& context) {
  Command& group = app.AddSubcommand("graph", "Import, solve, inspect and export the team's pose graph");
  group.RequireSubcommand();

  AddGraphImport(group, context);
  AddGraphExport(group, context);

  auto optimize = std::make_shared<OptimizeArguments>();
  Command& optimized = AddCommand(group, "optimize", "Solve the graph now, at the leader (or -a)",
                                  {"moonctl graph optimize --covariance-of rover2:17"});
  Option& scratch =
      optimized.AddFlag("--from-scratch", optimize->is_from_scratch, "Do not start from the last solution");
  optimized.AddOption("--window", optimize->window_nodes, "Move only this many newest nodes of each rover (faster)")
      .Within(1u, 1000000u)
      .Excludes(scratch);
  optimized.AddFlag("--covariance", optimize->has_covariance, "Show the covariance of each rover's newest node");
  optimized.AddOption("--covariance-of", optimize->covariance_of, "Show the covariance of these nodes: rover2:17");
  optimized.Callback(
      [&context, optimize] { context.action = [&context, optimize] { return OptimizeGraph(context, *optimize); }; });

  auto has_edges = std::make_shared<bool>(false);
  Command& stats =
      AddCommand(group, "stats", "Show the last solve and its verdicts on ranges, loop closures and priors",
                 {"moonctl graph stats --edges", kShows});
  stats.AddFlag("--edges", *has_edges, "List each rejected range, loop closure and prior");
  stats.Callback([&context, has_edges] {
    context.action = [&context, has_edges] { return ShowGraphStats(context, *has_edges); };
  });

  AddGraphMatches(group, context);
  AddGraphQuarantine(group, context);
  AddGraphSolve(group, context);
}

}  // namespace moondb
