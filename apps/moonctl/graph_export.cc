#include <algorithm>
#include <tuple>

#include "apps/common/graph_reading.h"
#include "apps/common/json_writer.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/file_origin.h"
#include "apps/moonctl/g2o_graph.h"
#include "apps/moonctl/graph_commands.h"
#include "apps/moonctl/team_letters.h"
#include "apps/moonctl/written_files.h"
#include "model/team_member.h"
#include "model/text.h"
#include "model/tum.h"
#include "views/track_view.h"

namespace moondb {
namespace {

struct ExportArguments {
  std::string file;
  std::string poses = "optimized";
  std::string format = "pyfg";
};

// The graph that an agent holds, sorted by node. Omits edges whose nodes have not arrived yet.
struct HeldGraph {
  PoseGraph graph;  // Has raw or optimized poses, as the user chose.
  // One for each of graph.ranges, then of graph.closures, then of graph.priors. Null: no verdict.
  std::vector<const PublishedVerdict*> verdicts;
  std::map<FactorKind, std::size_t> rejected_counts{
      {FactorKind::kRange, 0}, {FactorKind::kLoopClosure, 0}, {FactorKind::kPrior, 0}};
  std::size_t waiting_edge_count = 0;  // Number of omitted edges and priors.
  std::set<NodeKey> optimized;         // Nodes that have an optimized pose.
};

HeldGraph Arrange(const KnownGraph& known, bool is_optimized) {
  HeldGraph held;
  held.graph = known.graph();
  std::set<NodeKey> keys;
  const auto poses = is_optimized ? known.FindNewestPoses(held.graph.nodes) : std::map<NodeKey, Pose>();
  for (GraphNode& node : held.graph.nodes) {
    keys.insert(node.key);
    if (known.FindPublished(node.key) != nullptr) held.optimized.insert(node.key);
    if (is_optimized) node.map_from_node = poses.at(node.key);
  }
  const auto arrange = [&](auto& edges) {
    held.waiting_edge_count +=
        std::erase_if(edges, [&](const auto& edge) { return !keys.contains(edge.from) || !keys.contains(edge.to); });
    std::sort(edges.begin(), edges.end(), [](const auto& a, const auto& b) {
      return std::tie(a.from, a.to, a.timestamp_ns) < std::tie(b.from, b.to, b.timestamp_ns);
    });
  };
  std::sort(held.graph.nodes.begin(), held.graph.nodes.end(),
            [](const GraphNode& a, const GraphNode& b) { return a.key < b.key; });
  arrange(held.graph.odometry);
  arrange(held.graph.ranges);
  arrange(held.graph.closures);
  held.waiting_edge_count +=
      std::erase_if(held.graph.priors, [&](const NodePrior& prior) { return !keys.contains(prior.node); });
  const auto judge = [&](const auto& factors) {
    for (const auto& factor : factors) {
      const FactorKey key = KeyOf(factor);
      held.verdicts.push_back(known.FindVerdict(key));
      if (held.verdicts.back() != nullptr && !held.verdicts.back()->is_inlier) ++held.rejected_counts[key.kind];
    }
  };
  judge(held.graph.ranges);
  judge(held.graph.closures);
  judge(held.graph.priors);
  return held;
}

// Replaces each agent's id by the alphabet position of the letter that stands for the agent in the file
// (AgentsByLetter). The base station becomes a landmark without a timestamp, because PyFactorGraph's reader rejects
// timestamps of landmarks.
Result<Pyfg> ToLetters(const proto::TeamConfig& team, const PoseGraph& graph) {
  std::map<AgentId, AgentId> letters;
  for (const auto& [letter, agent] : AgentsByLetter(team)) letters[agent] = letter;
  if (AgentsByLetter(team).rbegin()->first > 52)
    return Fail(ErrorCode::kInvalid, "the graph has too many agents: PyFG and g2o name at most 52 agents by letters");
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
      pyfg.landmarks.push_back({node.key, std::nullopt, node.map_from_node.position_m});
    } else {
      pyfg.graph.nodes.push_back(node);
    }
  }
  pyfg.graph.odometry = graph.odometry;
  pyfg.graph.ranges = graph.ranges;
  pyfg.graph.closures = graph.closures;
  pyfg.graph.priors = graph.priors;
  for (OdometryEdge& edge : pyfg.graph.odometry) edge.from = rename(edge.from), edge.to = rename(edge.to);
  for (RangeEdge& edge : pyfg.graph.ranges) edge.from = rename(edge.from), edge.to = rename(edge.to);
  for (LoopClosure& edge : pyfg.graph.closures) edge.from = rename(edge.from), edge.to = rename(edge.to);
  for (NodePrior& prior : pyfg.graph.priors) prior.node = rename(prior.node);
  if (!is_named) return Fail(ErrorCode::kInvalid, "the graph has nodes of agents that the team file does not list");
  return pyfg;
}

// Returns a CSV with all ranges, loop closures and priors, and their verdicts. `named` is the exported graph: it has
// the same factors in the same order, with letters in place of agent ids.
std::string VerdictsText(const HeldGraph& held, const Pyfg& named) {
  std::string text = "from,to,timestamp_s,range_m,variance_m2,verdict,residual_sigmas,kind,source\n";
  std::size_t next = 0;
  const auto add = [&](const FactorKey& key, std::int64_t timestamp_ns, const std::string& range) {
    const PublishedVerdict* verdict = held.verdicts[next++];
    const bool is_judged = verdict != nullptr || key.kind == FactorKind::kRange;
    text += FormatKey(key.from) + "," + FormatKey(key.to) + "," + FormatTimestampNs(timestamp_ns) + "," + range + "," +
            (!is_judged                                 ? "none"
             : verdict == nullptr || verdict->is_inlier ? "accepted"
                                                        : "rejected") +
            "," + (verdict == nullptr ? "" : FormatDouble(verdict->residual_sigmas)) + "," + ToString(key.kind) + "," +
            key.source + "\n";
  };
  for (const RangeEdge& range : named.graph.ranges) {
    add(KeyOf(range), range.timestamp_ns, FormatDouble(range.range_m) + "," + FormatDouble(range.variance_m2));
  }
  for (const LoopClosure& closure : named.graph.closures) add(KeyOf(closure), closure.timestamp_ns, ",");
  for (const NodePrior& prior : named.graph.priors) add(KeyOf(prior), prior.timestamp_ns, ",");
  return text;
}

bool HasPoint(const NodePrior& prior) { return !prior.point_m.isZero(0); }

// Returns the graph without priors of another point than the body's origin, which PyFG and g2o cannot express.
Pyfg WithoutPointPriors(Pyfg pyfg) {
  std::erase_if(pyfg.graph.priors, HasPoint);
  return pyfg;
}

// The files of an exported graph, and the command's output about them.
struct GraphFiles {
  std::vector<FileBytes> files;
  JsonWriter json;  // A JSON object that is still open. The caller adds the notes and closes it.
  std::string text;
};

std::string PosesText(const ExportArguments& arguments) {
  return arguments.poses == "raw" ? "raw"
                                  : "optimized; newer nodes extended by odometry; raw if a rover has no optimized pose";
}

FileNotes NotesOn(const ExportArguments& arguments, const HeldGraph& held) {
  FileNotes notes{{"poses", PosesText(arguments)},
                  {"nodes", std::to_string(held.graph.nodes.size())},
                  {"optimized_nodes", std::to_string(held.optimized.size())},
                  {"odometry_edges", std::to_string(held.graph.odometry.size())},
                  {"ranges", std::to_string(held.graph.ranges.size())},
                  {"rejected_ranges", std::to_string(held.rejected_counts.at(FactorKind::kRange))},
                  {"loop_closures", std::to_string(held.graph.closures.size())},
                  {"rejected_loop_closures", std::to_string(held.rejected_counts.at(FactorKind::kLoopClosure))},
                  {"priors", std::to_string(held.graph.priors.size())},
                  {"rejected_priors", std::to_string(held.rejected_counts.at(FactorKind::kPrior))},
                  {"waiting_edges", std::to_string(held.waiting_edge_count)}};
  const auto point_priors = static_cast<std::size_t>(std::ranges::count_if(held.graph.priors, HasPoint));
  if (arguments.format == "g2o") notes.emplace_back("left_out", "ranges, because g2o has no range edges");
  if (point_priors > 0) {
    notes.emplace_back("left_out_priors",
                       std::to_string(point_priors) + ", because they measure a point other than the body's origin");
  }
  return notes;
}

// Returns a file for the notes, FILE.origin.txt. Notes as comments in the graph file would break common programs:
// PyFactorGraph, and for g2o the Ceres examples and SE-Sync.
FileBytes OriginFile(const std::string& file, const FileNotes& notes) {
  return {file + ".origin.txt", NotesText(notes)};
}

GraphFiles PyfgFiles(const HeldGraph& held, const Pyfg& named, const std::string& file, const FileNotes& notes) {
  const std::string verdicts = file + ".verdicts.csv";
  GraphFiles made;
  made.files = {
      OriginFile(file, notes), {verdicts, VerdictsText(held, named)}, {file, FormatPyfg(WithoutPointPriors(named))}};
  made.json.BeginObject().Key("file").String(file).Key("verdicts_file").String(verdicts);
  made.json.Key("origin_file").String(made.files.front().file.string());
  made.json.Key("nodes").Number(static_cast<double>(held.graph.nodes.size()));
  made.json.Key("optimized_nodes").Number(static_cast<double>(held.optimized.size()));
  made.json.Key("odometry").Number(static_cast<double>(held.graph.odometry.size()));
  made.json.Key("ranges").Number(static_cast<double>(held.graph.ranges.size()));
  const auto rejected = [&held](FactorKind kind) { return static_cast<double>(held.rejected_counts.at(kind)); };
  made.json.Key("rejected_ranges").Number(rejected(FactorKind::kRange));
  made.json.Key("loop_closures").Number(static_cast<double>(held.graph.closures.size()));
  made.json.Key("rejected_loop_closures").Number(rejected(FactorKind::kLoopClosure));
  made.json.Key("priors").Number(static_cast<double>(held.graph.priors.size()));
  made.json.Key("rejected_priors").Number(rejected(FactorKind::kPrior));
  made.text = "wrote " + file + ", " + verdicts + " and " + file + ".origin.txt\n";
  return made;
}

Result<GraphFiles> G2oFiles(const HeldGraph& held, const Pyfg& named, const std::string& file, const FileNotes& notes) {
  const Result<G2o> g2o = ToG2o(WithoutPointPriors(named));
  if (!g2o) return tl::unexpected(g2o.error());
  GraphFiles made;
  made.files = {OriginFile(file, notes), {file, FormatG2o(*g2o)}};
  made.json.BeginObject().Key("file").String(file).Key("origin_file").String(made.files.front().file.string());
  made.json.Key("nodes").Number(static_cast<double>(g2o->vertices.size()));
  made.json.Key("optimized_nodes").Number(static_cast<double>(held.optimized.size()));
  made.json.Key("odometry").Number(static_cast<double>(held.graph.odometry.size()));
  made.json.Key("loop_closures").Number(static_cast<double>(held.graph.closures.size()));
  made.json.Key("priors").Number(static_cast<double>(g2o->priors.size()));
  made.json.Key("left_out_ranges").Number(static_cast<double>(held.graph.ranges.size()));
  made.text = "wrote " + file + " and " + file + ".origin.txt\n";
  return made;
}

// Makes one file per agent, DIR/NAME.tum. The notes in each file describe only that agent's poses.
GraphFiles TumFiles(const proto::TeamConfig& team, const HeldGraph& held, const ExportArguments& arguments,
                    const FileOrigin& origin) {
  std::vector<PoseView> poses;
  for (const GraphNode& node : held.graph.nodes) {
    poses.push_back({node.key, node.timestamp_ns, node.map_from_node, held.optimized.contains(node.key)});
  }
  const std::vector<TrackView> tracks = TracksOf(poses);
  GraphFiles made;
  made.json.BeginObject().Key("files").BeginArray();
  for (const TrackView& track : tracks) {
    const std::string name = AgentName(team, track.agent);
    const FileNotes notes = NotesOf(origin, {{"trajectory_of", name},
                                             {"poses", PosesText(arguments)},
                                             {"nodes", std::to_string(track.poses.size())},
                                             {"optimized_nodes", std::to_string(track.CountOptimized())}});
    const std::filesystem::path file = std::filesystem::path(arguments.file) / (name + ".tum");
    std::vector<TumPose> lines;
    for (const PoseView& pose : track.poses) lines.push_back({pose.timestamp_ns, pose.map_from_body});
    made.files.push_back({file, FormatTum(lines, notes)});
    made.json.String(file.string());
    made.text += "wrote " + file.string() + ": " + std::to_string(track.poses.size()) + " poses\n";
  }
  made.json.EndArray();
  if (tracks.empty()) made.text = "the graph has no nodes\n";
  return made;
}

Result<GraphFiles> FilesOf(const proto::TeamConfig& team, const HeldGraph& held, const ExportArguments& arguments,
                           const FileOrigin& origin, const FileNotes& notes) {
  if (arguments.format == "tum") return TumFiles(team, held, arguments, origin);
  const Result<Pyfg> named = ToLetters(team, held.graph);
  if (!named) return tl::unexpected(named.error());
  if (arguments.format == "g2o") return G2oFiles(held, *named, arguments.file, notes);
  return PyfgFiles(held, *named, arguments.file, notes);
}

ExitCode ExportGraph(CommandContext& context, const ExportArguments& arguments) {
  auto target = context.ConnectToChosenOrLeader();
  if (!target) return context.Report(target.error());
  const proto::TeamConfig& team = (*context.Team())->config;
  const auto known = ReadGraphOf(*target->client, team);
  if (!known) return context.Report(known.error());
  const HeldGraph held = Arrange(*known, arguments.poses == "optimized");
  const FileOrigin origin = OriginOf(team, *target);
  const FileNotes notes = NotesOf(origin, NotesOn(arguments, held));
  auto made = FilesOf(team, held, arguments, origin, notes);
  if (!made) return context.Report(made.error());
  const std::string folder = arguments.format == "tum" ? arguments.file : "";
  if (auto written = WriteTogether(folder, made->files); !written) return context.Report(written.error());
  made->json.Key("notes").WriteNotes(notes).EndObject();
  return context.Done(made->json.text(), made->text + NotesText(notes));
}

}  // namespace

void AddGraphExport(Command& group, CommandContext& context) {
  auto arguments = std::make_shared<ExportArguments>();
  Command& command = AddCommand(
      group, "export", "Export the graph of the leader (or -a); also writes FILE.verdicts.csv and FILE.origin.txt",
      {"moonctl graph export graph.g2o --format g2o"});
  command.AddOption("file", arguments->file, "Output file; for TUM a folder with one file per agent")
      .TypeName("FILE")
      .Required();
  command.AddOption("--format", arguments->format, "Format: pyfg, g2o (without ranges) or tum (only trajectories)")
      .OneOf({"pyfg", "g2o", "tum"});
  command.AddOption("--poses", arguments->poses, "Poses to write: optimized (if available) or raw")
      .OneOf({"optimized", "raw"});
  command.Callback(
      [&context, arguments] { context.action = [&context, arguments] { return ExportGraph(context, *arguments); }; });
}

}  // namespace moondb
