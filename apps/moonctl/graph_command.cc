#include <CLI/CLI.hpp>

#include "apps/common/graph_reading.h"
#include "apps/common/json_writer.h"
#include "apps/common/progress.h"
#include "apps/common/proto_json.h"
#include "apps/common/table.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/graph_import.h"
#include "apps/moonctl/team_letters.h"
#include "model/text.h"
#include "model/tum.h"

namespace moondb {
namespace {

struct GraphArguments {
  std::string file;
  std::string poses = "optimized";
  std::string format = "pyfg";
};

std::string Count(std::size_t count) { return std::to_string(count); }

ExitCode ImportGraph(CommandContext& context, const GraphArguments& arguments) {
  auto team = context.Team();
  if (!team) return context.Report(team.error());
  auto pyfg = ReadPyfg(arguments.file);
  if (!pyfg) return context.Report(pyfg.error());
  auto import = PrepareImport((*team)->config, *pyfg);
  if (!import) return context.Report(import.error());

  // All agents must be there before the first record goes anywhere.
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

// The graph under the file's letters, with the chosen poses as vertices.
Result<Pyfg> ToPyfg(const proto::TeamConfig& team, const ReadGraph& read, bool is_optimized) {
  std::map<AgentId, AgentId> letters;
  for (const auto& [letter, agent] : AgentsByLetter(team)) letters[agent] = letter;
  const AgentId base = BaseStationOf(team);
  Pyfg pyfg;
  pyfg.graph = read.graph;
  std::erase_if(pyfg.graph.nodes, [base](const GraphNode& node) { return node.key.agent == base; });
  for (const GraphNode& node : read.graph.nodes) {
    if (node.key.agent == base) pyfg.landmarks.push_back({node.key, node.stamp_ns, read.NewestPose(node).position_m});
  }
  std::set<NodeKey> known;
  for (const GraphNode& node : read.graph.nodes) known.insert(node.key);
  // An edge may have come before its nodes.
  const auto is_dangling = [&](const auto& edge) { return !known.contains(edge.from) || !known.contains(edge.to); };
  std::erase_if(pyfg.graph.odometry, is_dangling);
  std::erase_if(pyfg.graph.ranges, is_dangling);

  const auto rename = [&](NodeKey& key) { key.agent = letters.contains(key.agent) ? letters[key.agent] : 0; };
  bool is_named = true;
  for (GraphNode& node : pyfg.graph.nodes) {
    if (is_optimized) node.map_from_node = read.NewestPose(node);
    rename(node.key);
    is_named = is_named && node.key.agent != 0;
  }
  for (PyfgLandmark& landmark : pyfg.landmarks) rename(landmark.key);
  for (OdometryEdge& edge : pyfg.graph.odometry) rename(edge.from), rename(edge.to);
  for (RangeEdge& edge : pyfg.graph.ranges) rename(edge.from), rename(edge.to);
  if (!is_named) return Fail(ErrorCode::kInvalid, "the graph has nodes of agents that the team file does not name");
  if (AgentsByLetter(team).rbegin()->first > 52) {
    return Fail(ErrorCode::kInvalid, "PyFG has letters for 52 agents at most");
  }
  return pyfg;
}

// One file a rover: DIR/NAME.tum.
ExitCode ExportTrajectories(CommandContext& context, const ReadGraph& read, const GraphArguments& arguments) {
  const proto::TeamConfig& team = (*context.Team())->config;
  std::map<AgentId, std::map<NodeKey, TumPose>> tracks;
  for (const GraphNode& node : read.graph.nodes) {
    const Pose pose = arguments.poses == "optimized" ? read.NewestPose(node) : node.map_from_node;
    tracks[node.key.agent].emplace(node.key, TumPose{node.stamp_ns, pose});
  }
  std::error_code error;
  std::filesystem::create_directories(arguments.file, error);
  JsonWriter json;
  json.BeginObject().Key("files").BeginArray();
  std::string text;
  for (const auto& [agent, track] : tracks) {
    std::vector<TumPose> poses;
    for (const auto& [key, pose] : track) poses.push_back(pose);
    const std::filesystem::path file = std::filesystem::path(arguments.file) / (AgentName(team, agent) + ".tum");
    if (auto written = WriteTum(poses, file); !written) return context.Report(written.error());
    json.String(file.string());
    text += (text.empty() ? "" : "\n") + ("wrote " + file.string() + ": " + Count(poses.size()) + " poses");
  }
  json.EndArray().EndObject();
  return context.Done(json.text(), text.empty() ? "the graph has no node" : text);
}

ExitCode ExportGraph(CommandContext& context, const GraphArguments& arguments) {
  auto target = context.ConnectToChosenOrLeader();
  if (!target) return context.Report(target.error());
  auto read = ReadGraphOf(*target->client);
  if (!read) return context.Report(read.error());
  if (arguments.format == "tum") return ExportTrajectories(context, *read, arguments);
  auto pyfg = ToPyfg((*context.Team())->config, *read, arguments.poses == "optimized");
  if (!pyfg) return context.Report(pyfg.error());
  if (auto written = WritePyfg(*pyfg, arguments.file); !written) return context.Report(written.error());
  JsonWriter json;
  json.BeginObject().Key("file").String(arguments.file);
  json.Key("nodes").Number(static_cast<double>(read->graph.nodes.size()));
  json.Key("optimized_nodes").Number(static_cast<double>(read->optimized.size()));
  json.Key("odometry").Number(static_cast<double>(pyfg->graph.odometry.size()));
  json.Key("ranges").Number(static_cast<double>(pyfg->graph.ranges.size())).EndObject();
  return context.Done(json.text(), "wrote " + arguments.file + ": " + Count(read->graph.nodes.size()) + " nodes (" +
                                       Count(read->optimized.size()) + " optimized), " +
                                       Count(pyfg->graph.odometry.size()) + " odometry edges, " +
                                       Count(pyfg->graph.ranges.size()) + " ranges");
}

std::string SolveText(const proto::TeamConfig& team, const proto::OptimizeReply& solve) {
  std::string text = FormatCount(solve.node_count()) + " nodes, " + FormatCount(solve.odometry_count()) +
                     " odometry edges, " + FormatCount(solve.range_count()) + " ranges (" +
                     FormatCount(solve.rejected_range_count()) + " rejected)\ncost " +
                     FormatFixed(solve.initial_cost(), 2) + " to " + FormatFixed(solve.final_cost(), 2) + " in " +
                     FormatCount(solve.iterations()) + " iterations, " + FormatFixed(solve.seconds(), 3) + " s; " +
                     FormatCount(solve.updated_pose_count()) + " poses written\n";
  Table table({"ROVER", "NODES", "ANCHORED", "ODOMETRY SCALE", "NOTE"});
  for (const proto::RoverSolution& rover : solve.rovers()) {
    table.Add({AgentName(team, rover.agent_id()), FormatCount(rover.node_count()), rover.is_anchored() ? "yes" : "no",
               FormatFixed(rover.odometry_scale(), 4), rover.text()});
  }
  return text + table.Text();
}

ExitCode OptimizeGraph(CommandContext& context) {
  auto target = context.ConnectToChosenOrLeader();
  if (!target) return context.Report(target.error());
  auto solve = target->client->Optimize();
  if (!solve) return context.Report(solve.error());
  return context.Done(ToJson(*solve), SolveText((*context.Team())->config, *solve));
}

ExitCode ShowGraphStats(CommandContext& context) {
  auto target = context.ConnectToChosenOrLeader();
  if (!target) return context.Report(target.error());
  auto stats = target->client->GraphStats();
  if (!stats) return context.Report(stats.error());
  const std::string text = stats->solve_count() == 0
                               ? target->agent->name() + " has not solved the graph since it started"
                               : FormatCount(stats->solve_count()) + " solves since the start; the last one:\n" +
                                     SolveText((*context.Team())->config, stats->last_solve());
  return context.Done(ToJson(*stats), text);
}

}  // namespace

void AddGraphCommands(CLI::App& app, CommandContext& context) {
  CLI::App& group = *app.add_subcommand("graph", "The team's pose graph");
  group.require_subcommand(1);
  auto arguments = std::make_shared<GraphArguments>();

  CLI::App& imported = *group.add_subcommand("import", "Insert a PyFG file, each rover's part at its own agent");
  imported.add_option("file", arguments->file, "PyFG file")->required();
  imported.callback(
      [&context, arguments] { context.action = [&context, arguments] { return ImportGraph(context, *arguments); }; });
  CLI::App& exported = *group.add_subcommand("export", "Write the graph that the leader (or -a) holds");
  exported.add_option("file", arguments->file, "PyFG file; for TUM a folder, which gets one file per agent")
      ->required();
  exported.add_option("--format", arguments->format, "pyfg, or tum: the trajectories alone")
      ->check(CLI::IsMember({"pyfg", "tum"}));
  exported.add_option("--poses", arguments->poses, "optimized (where there are any) or raw")
      ->check(CLI::IsMember({"optimized", "raw"}));
  exported.callback(
      [&context, arguments] { context.action = [&context, arguments] { return ExportGraph(context, *arguments); }; });
  group.add_subcommand("optimize", "Solve it now, at the leader (or -a)")->callback([&context] {
    context.action = [&context] { return OptimizeGraph(context); };
  });
  group.add_subcommand("stats", "The last solve")->callback([&context] {
    context.action = [&context] { return ShowGraphStats(context); };
  });
}

}  // namespace moondb
