#include <CLI/CLI.hpp>
#include <algorithm>
#include <tuple>

#include "apps/common/graph_reading.h"
#include "apps/common/json_writer.h"
#include "apps/moonctl/g2o_graph.h"
#include "apps/moonctl/graph_commands.h"
#include "apps/moonctl/team_letters.h"
#include "model/text.h"
#include "model/tum.h"

namespace moondb {
namespace {

struct ExportArguments {
  std::string file;
  std::string poses = "optimized";
  std::string format = "pyfg";
};

std::string Count(std::size_t count) { return std::to_string(count); }

// What an agent holds, in the order of names, without edges whose nodes have not come yet.
struct HeldGraph {
  PoseGraph graph;                                // At the chosen poses.
  std::vector<const PublishedVerdict*> verdicts;  // Of graph.ranges; null where nobody spoke of it.
  std::size_t rejected_count = 0;
  std::size_t optimized_count = 0;  // Nodes that have an optimized pose.
};

HeldGraph Arrange(const KnownGraph& known, bool is_optimized) {
  HeldGraph held;
  held.graph = known.graph();
  std::set<NodeKey> keys;
  for (GraphNode& node : held.graph.nodes) {
    keys.insert(node.key);
    held.optimized_count += known.FindPublished(node.key) != nullptr ? 1 : 0;
    if (is_optimized) node.map_from_node = known.NewestPose(node);
  }
  const auto arrange = [&keys](auto& edges) {
    std::erase_if(edges, [&](const auto& edge) { return !keys.contains(edge.from) || !keys.contains(edge.to); });
    std::sort(edges.begin(), edges.end(), [](const auto& a, const auto& b) {
      return std::tie(a.from, a.to, a.stamp_ns) < std::tie(b.from, b.to, b.stamp_ns);
    });
  };
  std::sort(held.graph.nodes.begin(), held.graph.nodes.end(),
            [](const GraphNode& a, const GraphNode& b) { return a.key < b.key; });
  arrange(held.graph.odometry);
  arrange(held.graph.ranges);
  for (const RangeEdge& range : held.graph.ranges) {
    held.verdicts.push_back(known.FindVerdict({range.from, range.to}));
    if (held.verdicts.back() != nullptr && !held.verdicts.back()->is_inlier) ++held.rejected_count;
  }
  return held;
}

// Under the file's letters; the base station is a landmark.
Result<Pyfg> ToLetters(const proto::TeamConfig& team, const PoseGraph& graph) {
  std::map<AgentId, AgentId> letters;
  for (const auto& [letter, agent] : AgentsByLetter(team)) letters[agent] = letter;
  if (AgentsByLetter(team).rbegin()->first > 52)
    return Fail(ErrorCode::kInvalid, "PyFG and g2o have letters for 52 agents at most");
  bool is_named = true;
  const auto rename = [&](NodeKey key) {
    const auto letter = letters.find(key.agent);
    is_named = is_named && letter != letters.end();
    return NodeKey{is_named ? letter->second : 0, key.index};
  };
  const AgentId base = BaseStationOf(team);
  Pyfg pyfg;
  for (GraphNode node : graph.nodes) {
    const bool is_landmark = node.key.agent == base;
    node.key = rename(node.key);
    if (is_landmark) {
      pyfg.landmarks.push_back({node.key, node.stamp_ns, node.map_from_node.position_m});
    } else {
      pyfg.graph.nodes.push_back(node);
    }
  }
  pyfg.graph.odometry = graph.odometry;
  pyfg.graph.ranges = graph.ranges;
  for (OdometryEdge& edge : pyfg.graph.odometry) edge.from = rename(edge.from), edge.to = rename(edge.to);
  for (RangeEdge& edge : pyfg.graph.ranges) edge.from = rename(edge.from), edge.to = rename(edge.to);
  if (!is_named) return Fail(ErrorCode::kInvalid, "the graph has nodes of agents that the team file does not name");
  return pyfg;
}

// `named` has the ranges under the names that the other file uses.
std::string VerdictsText(const HeldGraph& held, const Pyfg& named) {
  std::string text = "from,to,stamp_s,range_m,variance_m2,verdict,residual_sigmas\n";
  for (std::size_t i = 0; i < held.graph.ranges.size(); ++i) {
    const RangeEdge& range = named.graph.ranges[i];
    const PublishedVerdict* verdict = held.verdicts[i];
    text += FormatKey(range.from) + "," + FormatKey(range.to) + "," + FormatStampNs(range.stamp_ns) + "," +
            FormatDouble(range.range_m) + "," + FormatDouble(range.variance_m2) + "," +
            (verdict == nullptr || verdict->is_inlier ? "accepted" : "rejected") + "," +
            (verdict == nullptr ? "" : FormatDouble(verdict->residual_sigmas)) + "\n";
  }
  return text;
}

ExitCode ExportPyfg(CommandContext& context, const HeldGraph& held, const Pyfg& named, const std::string& file) {
  const std::string verdicts = file + ".verdicts.csv";
  if (auto written = WritePyfg(named, file); !written) return context.Report(written.error());
  if (auto written = WriteTextFile(verdicts, VerdictsText(held, named)); !written) {
    return context.Report(written.error());
  }
  JsonWriter json;
  json.BeginObject().Key("file").String(file).Key("verdicts_file").String(verdicts);
  json.Key("nodes").Number(static_cast<double>(held.graph.nodes.size()));
  json.Key("optimized_nodes").Number(static_cast<double>(held.optimized_count));
  json.Key("odometry").Number(static_cast<double>(held.graph.odometry.size()));
  json.Key("ranges").Number(static_cast<double>(held.graph.ranges.size()));
  json.Key("rejected_ranges").Number(static_cast<double>(held.rejected_count)).EndObject();
  return context.Done(json.text(), "wrote " + file + ": " + Count(held.graph.nodes.size()) + " nodes (" +
                                       Count(held.optimized_count) + " optimized), " +
                                       Count(held.graph.odometry.size()) + " odometry edges, " +
                                       Count(held.graph.ranges.size()) + " ranges\nwrote " + verdicts + ": " +
                                       Count(held.rejected_count) + " of the ranges are rejected");
}

ExitCode ExportG2o(CommandContext& context, const HeldGraph& held, const Pyfg& named, const std::string& file) {
  const Result<G2o> g2o = ToG2o(named);
  if (!g2o) return context.Report(g2o.error());
  if (auto written = WriteG2o(*g2o, file); !written) return context.Report(written.error());
  JsonWriter json;
  json.BeginObject().Key("file").String(file);
  json.Key("nodes").Number(static_cast<double>(g2o->vertices.size()));
  json.Key("optimized_nodes").Number(static_cast<double>(held.optimized_count));
  json.Key("odometry").Number(static_cast<double>(g2o->edges.size()));
  json.Key("left_out_ranges").Number(static_cast<double>(held.graph.ranges.size())).EndObject();
  return context.Done(json.text(), "wrote " + file + ": " + Count(g2o->vertices.size()) + " nodes (" +
                                       Count(held.optimized_count) + " optimized), " + Count(g2o->edges.size()) +
                                       " odometry edges; g2o has no ranges: " + Count(held.graph.ranges.size()) +
                                       " are left out");
}

// One file an agent: DIR/NAME.tum.
ExitCode ExportTrajectories(CommandContext& context, const HeldGraph& held, const std::string& folder) {
  const proto::TeamConfig& team = (*context.Team())->config;
  std::map<AgentId, std::vector<TumPose>> tracks;
  for (const GraphNode& node : held.graph.nodes) tracks[node.key.agent].push_back({node.stamp_ns, node.map_from_node});
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  JsonWriter json;
  json.BeginObject().Key("files").BeginArray();
  std::string text;
  for (const auto& [agent, track] : tracks) {
    const std::filesystem::path file = std::filesystem::path(folder) / (AgentName(team, agent) + ".tum");
    if (auto written = WriteTum(track, file); !written) return context.Report(written.error());
    json.String(file.string());
    text += (text.empty() ? "" : "\n") + ("wrote " + file.string() + ": " + Count(track.size()) + " poses");
  }
  json.EndArray().EndObject();
  return context.Done(json.text(), text.empty() ? "the graph has no node" : text);
}

ExitCode ExportGraph(CommandContext& context, const ExportArguments& arguments) {
  auto target = context.ConnectToChosenOrLeader();
  if (!target) return context.Report(target.error());
  const auto known = ReadGraphOf(*target->client);
  if (!known) return context.Report(known.error());
  const HeldGraph held = Arrange(*known, arguments.poses == "optimized");
  if (arguments.format == "tum") return ExportTrajectories(context, held, arguments.file);
  const Result<Pyfg> named = ToLetters((*context.Team())->config, held.graph);
  if (!named) return context.Report(named.error());
  return arguments.format == "g2o" ? ExportG2o(context, held, *named, arguments.file)
                                   : ExportPyfg(context, held, *named, arguments.file);
}

}  // namespace

void AddGraphExport(CLI::App& group, CommandContext& context) {
  auto arguments = std::make_shared<ExportArguments>();
  CLI::App& command = *group.add_subcommand(
      "export", "Write the graph that the leader (or -a) holds; what was judged of ranges goes to FILE.verdicts.csv");
  command.add_option("file", arguments->file, "The file; for TUM a folder, which gets one file per agent")
      ->type_name("FILE")
      ->required();
  command
      .add_option("--format", arguments->format,
                  "pyfg, g2o (poses and odometry: it has no ranges), or tum (the trajectories alone)")
      ->check(CLI::IsMember({"pyfg", "g2o", "tum"}));
  command.add_option("--poses", arguments->poses, "optimized (where there are any) or raw")
      ->check(CLI::IsMember({"optimized", "raw"}));
  command.callback(
      [&context, arguments] { context.action = [&context, arguments] { return ExportGraph(context, *arguments); }; });
}

}  // namespace moondb
