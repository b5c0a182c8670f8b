#include <algorithm>
#include <cmath>

#include "apps/common/graph_reading.h"
#include "apps/common/json_writer.h"
#include "apps/common/progress.h"
#include "apps/common/proto_json.h"
#include "apps/common/table.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/g2o_graph.h"
#include "apps/moonctl/graph_commands.h"
#include "apps/moonctl/graph_import.h"
#include "apps/moonctl/team_letters.h"
#include "model/text.h"

namespace moondb {
namespace {

struct OptimizeArguments {
  bool is_from_scratch = false;
  std::uint32_t window_nodes = 0;
  bool has_covariance = false;
  std::vector<std::string> covariance_of;  // Names of nodes, such as "rover2:17".
};

std::string Count(std::size_t count) { return std::to_string(count); }

// Reads a PyFG or g2o file. Converts g2o to PyFG.
Result<Pyfg> ReadImported(CommandContext& context, const proto::TeamConfig& team, const std::string& file) {
  if (std::filesystem::path(file).extension() != ".g2o") return ReadPyfg(file);
  AgentId plain_agent = 0;
  if (!context.agent.empty()) {
    const auto chosen = context.ChosenAgents();
    if (!chosen) return tl::unexpected(chosen.error());
    for (const auto& [letter, agent] : AgentsByLetter(team)) {
      if (agent == chosen->front()->id()) plain_agent = letter;
    }
  }
  return ReadG2o(file).and_then([plain_agent](const G2o& g2o) { return ToPyfg(g2o, plain_agent); });
}

ExitCode ImportGraph(CommandContext& context, const std::string& file) {
  auto team = context.Team();
  if (!team) return context.Report(team.error());
  auto pyfg = ReadImported(context, (*team)->config, file);
  if (!pyfg) return context.Report(InputError(pyfg.error()));
  auto import = PrepareImport((*team)->config, *pyfg);
  if (!import) return context.Report(import.error());

  // Connect to all agents before inserting the first record.
  std::map<AgentId, AgentClient> clients;
  std::size_t total = 0;
  for (const auto& [agent, records] : import->records) {
    auto connected = context.Connect(AgentName((*team)->config, agent));
    if (!connected) return context.Report(connected.error());
    clients.emplace(agent, std::move(*connected));
    total += records.size();
  }
  Progress progress("import");
  std::size_t before = 0;
  for (const auto& [agent, records] : import->records) {
    const auto show = [&](std::size_t count) {
      progress.Show(static_cast<double>(before + count), static_cast<double>(total),
                    Count(before + count) + " of " + Count(total) + " records");
    };
    if (auto done = InsertInBatches(*clients.at(agent).client, records, show); !done) {
      return context.Report(done.error());
    }
    before += records.size();
  }
  JsonWriter json;
  json.BeginObject().Key("nodes").Number(static_cast<double>(import->node_count));
  json.Key("odometry").Number(static_cast<double>(import->odometry_count));
  json.Key("ranges").Number(static_cast<double>(import->range_count));
  json.Key("left_out").Number(static_cast<double>(import->left_out_count)).EndObject();
  return context.Done(json.text(), "inserted " + Count(import->node_count) + " nodes, " +
                                       Count(import->odometry_count) + " odometry edges and " +
                                       Count(import->range_count) + " ranges at " + Count(clients.size()) +
                                       " agents; left out " + Count(import->left_out_count));
}

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

// Returns the name of a node, such as "rover2:17", in the form that ParseNode parses.
std::string NodeName(const proto::TeamConfig& team, const NodeKey& node) {
  return AgentName(team, node.agent) + ":" + std::to_string(node.index);
}

// Returns the standard deviation of one coordinate of a pose as text, or "-" without a valid covariance. Coordinates 0
// to 2 are the position, 3 to 5 the rotation.
std::string SigmaText(const proto::NodeCovariance& node, int coordinate, const char* unit) {
  const auto covariance = FromUpperTriangle(node.covariance());
  if (!covariance) return "-";
  return FormatFixed(std::sqrt((*covariance)(coordinate, coordinate)), 3) + " " + unit;
}

std::string SolveText(const proto::TeamConfig& team, const proto::OptimizeReply& solve) {
  if (IsError(solve.error())) return "it failed: " + FromProto(solve.error()).text + "\n";
  std::string text =
      FormatCount(solve.node_count()) + " nodes, " + FormatCount(solve.odometry_count()) + " odometry edges, " +
      FormatCount(solve.range_count()) + " ranges (" + FormatCount(solve.rejected_range_count()) + " rejected)\ncost " +
      FormatFixed(solve.initial_cost(), 2) + " to " + FormatFixed(solve.final_cost(), 2) + " in " +
      FormatCount(solve.iterations()) + " iterations, " + FormatFixed(solve.seconds(), 3) +
      " s, begun at: " + solve.initial_values() + "; " + FormatCount(solve.updated_pose_count()) + " poses written\n";
  if (!solve.text().empty()) text += solve.text() + "\n";
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

// Parses the name of a node, such as "rover2:17".
Result<proto::NodeKey> ParseNode(const proto::TeamConfig& team, const std::string& text) {
  const std::size_t colon = text.find(':');
  const std::string name = text.substr(0, colon);
  for (const proto::AgentConfig& agent : team.agents()) {
    const auto index = colon == std::string::npos ? std::nullopt : ParseUnsigned(text.substr(colon + 1));
    if (agent.name() == name && index) return ToProto(NodeKey{agent.id(), *index});
  }
  return Fail(ErrorCode::kInvalid, "'" + text + "' is no node of the team, such as rover2:17", "--covariance-of");
}

ExitCode OptimizeGraph(CommandContext& context, const OptimizeArguments& arguments) {
  const auto team = context.Team();
  if (!team) return context.Report(team.error());
  proto::OptimizeRequest request;
  request.set_from_scratch(arguments.is_from_scratch);
  request.set_window_nodes(arguments.window_nodes);
  request.set_with_covariance(arguments.has_covariance);
  for (const std::string& text : arguments.covariance_of) {
    const auto node = ParseNode((*team)->config, text);
    if (!node) return context.Report(node.error());
    *request.add_covariance_of() = *node;
  }
  auto target = context.ConnectToChosenOrLeader();
  if (!target) return context.Report(target.error());
  auto solve = target->client->Optimize(request);
  if (!solve) return context.Report(solve.error());
  return context.Done(ToJson(*solve), SolveText((*team)->config, *solve));
}

// Statistics of the ranges between two agents. A range counts as rejected if its newest verdict rejects it.
struct PairStats {
  std::size_t range_count = 0;
  std::size_t rejected_count = 0;
  double worst_sigmas = 0;  // Residual with the largest magnitude among the rejected ranges, in sigmas.
};

using AgentPair = std::pair<AgentId, AgentId>;  // Two agents, the smaller id first.

struct RejectedRange {
  const RangeEdge* range = nullptr;
  double residual_sigmas = 0;
};

struct RangeStats {
  std::map<AgentPair, PairStats> pairs;
  std::vector<RejectedRange> rejected;
};

// Returns the statistics of all ranges in `known`. The result points into `known`.
RangeStats FindRangeStats(const KnownGraph& known) {
  RangeStats stats;
  for (const RangeEdge& range : known.graph().ranges) {
    PairStats& pair = stats.pairs[std::minmax(range.from.agent, range.to.agent)];
    ++pair.range_count;
    const PublishedVerdict* verdict = known.FindVerdict({range.from, range.to});
    if (verdict == nullptr || verdict->is_inlier) continue;
    stats.rejected.push_back({&range, verdict->residual_sigmas});
    ++pair.rejected_count;
    if (std::abs(verdict->residual_sigmas) > std::abs(pair.worst_sigmas)) pair.worst_sigmas = verdict->residual_sigmas;
  }
  return stats;
}

std::string PairsText(const proto::TeamConfig& team, const std::map<AgentPair, PairStats>& pairs) {
  if (pairs.empty()) return "no range is held here\n";
  Table table({"RANGES BETWEEN", "", "HELD", "REJECTED", "WORST SIGMAS"});
  for (const auto& [agents, pair] : pairs) {
    table.Add({AgentName(team, agents.first), AgentName(team, agents.second), std::to_string(pair.range_count),
               std::to_string(pair.rejected_count),
               pair.rejected_count == 0 ? "-" : FormatFixed(pair.worst_sigmas, 1)});
  }
  return table.Text();
}

std::string RejectedText(const proto::TeamConfig& team, const std::vector<RejectedRange>& rejected) {
  Table table({"REJECTED", "", "RANGE m", "SIGMAS"});
  for (const auto& [range, residual_sigmas] : rejected) {
    table.Add({NodeName(team, range->from), NodeName(team, range->to), FormatFixed(range->range_m, 3),
               FormatFixed(residual_sigmas, 1)});
  }
  return table.Text();
}

void WriteRanges(const proto::TeamConfig& team, const RangeStats& stats, JsonWriter& json) {
  json.Key("pairs").BeginArray();
  for (const auto& [agents, pair] : stats.pairs) {
    json.BeginObject().Key("agents").BeginArray();
    json.String(AgentName(team, agents.first)).String(AgentName(team, agents.second)).EndArray();
    json.Key("ranges").Number(static_cast<double>(pair.range_count));
    json.Key("rejected").Number(static_cast<double>(pair.rejected_count));
    json.Key("worst_sigmas").Number(pair.worst_sigmas).EndObject();
  }
  json.EndArray().Key("rejected").BeginArray();
  for (const auto& [range, residual_sigmas] : stats.rejected) {
    json.BeginObject().Key("from").Raw(ToJson(ToProto(range->from))).Key("to").Raw(ToJson(ToProto(range->to)));
    json.Key("range_m").Number(range->range_m).Key("residual_sigmas").Number(residual_sigmas).EndObject();
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
                         : FormatCount(stats->solve_count()) + " solves since the start; the last one:\n" +
                               SolveText(team, stats->last_solve());
  const RangeStats ranges = FindRangeStats(*known);
  text += PairsText(team, ranges.pairs);
  if (has_edges) text += RejectedText(team, ranges.rejected);
  JsonWriter json;
  json.BeginObject().Key("solve_count").Number(stats->solve_count());
  json.Key("last_solve").Raw(ToJson(stats->last_solve()));
  WriteRanges(team, ranges, json);
  json.EndObject();
  return context.Done(json.text(), text);
}

}  // namespace

void AddGraphCommands(Command& app, CommandContext& context) {
  Command& group = app.AddSubcommand("graph", "The team's pose graph");
  group.RequireSubcommand();

  auto file = std::make_shared<std::string>();
  Command& imported =
      AddCommand(group, "import", "Insert a PyFG or g2o file, each rover's part at its own agent (g2o: see -a)",
                 {"moonctl graph import mission.pyfg"});
  imported.AddOption("file", *file, "A .g2o file; anything else is read as PyFG").TypeName("FILE").Required();
  imported.Callback([&context, file] { context.action = [&context, file] { return ImportGraph(context, *file); }; });

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
  Command& stats = AddCommand(group, "stats", "Show the last solve and the verdicts on ranges",
                              {"moonctl graph stats --edges", kShows});
  stats.AddFlag("--edges", *has_edges, "List each rejected range");
  stats.Callback([&context, has_edges] {
    context.action = [&context, has_edges] { return ShowGraphStats(context, *has_edges); };
  });

  AddGraphSolve(group, context);
}

}  // namespace moondb
