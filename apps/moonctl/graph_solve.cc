#include <chrono>

#include "actors/pgo/standalone_solver.h"
#include "apps/common/json_writer.h"
#include "apps/common/table.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/graph_commands.h"
#include "apps/moonctl/graph_files.h"
#include "model/text.h"

namespace moondb {
namespace {

struct SolveArguments {
  GraphFileArguments input;
  std::string out;
  std::vector<std::string> fixed;
  bool starts_at_vertices = false;
  bool is_isotropic = false;
  int threads = 2;
};

Result<GraphFile> ReadInput(const SolveArguments& arguments) {
  const bool is_g2o = IsG2o(arguments.input.files.front());
  if (arguments.is_isotropic && !is_g2o) return Fail(ErrorCode::kInvalid, "applies only to .g2o files", "--isotropic");
  if (!arguments.out.empty() && IsG2o(arguments.out) != is_g2o) {
    return Fail(ErrorCode::kInvalid, "must have the same format as the input files", "--out");
  }
  return ReadGraphFile(arguments.input,
                       arguments.is_isotropic ? InformationCheck::kBlocks : InformationCheck::kPositiveDefinite);
}

Result<NodeKey> PyfgKey(const std::string& text) {
  if (const auto key = ParseKey(text)) return *key;
  return Fail(ErrorCode::kInvalid,
              "'" + text + "' is not the key of a node, which is a letter and a number, such as L0", "--fix");
}

Result<NodeKey> G2oKey(const std::string& text) {
  if (const auto id = ParseUnsigned(text)) return NodeKey{0, *id};
  return Fail(ErrorCode::kInvalid, "'" + text + "' is not the id of a vertex, which is a number", "--fix");
}

// Converts the file to a graph. The solver keeps the nodes named by `fixed` at their poses in the file.
Result<StandaloneGraph> ToPlain(GraphFile& file, const std::vector<std::string>& fixed) {
  std::set<NodeKey> keys;
  for (const std::string& text : fixed) {
    const Result<NodeKey> key = file.is_g2o ? G2oKey(text) : PyfgKey(text);
    if (!key) return tl::unexpected(key.error());
    if (file.is_g2o) file.g2o.fixed.push_back(key->index);
    keys.insert(*key);
  }
  StandaloneGraph graph = file.is_g2o ? ToStandaloneGraph(file.g2o) : ToStandaloneGraph(file.pyfg, keys);
  for (const NodeKey& key : keys) {
    const bool is_there = std::any_of(graph.nodes.begin(), graph.nodes.end(),
                                      [&key](const PlainNode& node) { return node.key == key && node.is_fixed; });
    if (!is_there) return Fail(ErrorCode::kInvalid, "the graph has no vertex with this name", "--fix");
  }
  return graph;
}

// Writes the graph file with the solved poses.
Result<void> WriteSolved(GraphFile file, const StandaloneGraph& graph, const PlainSolution& solution,
                         const std::string& out) {
  std::map<NodeKey, Pose> poses;
  for (std::size_t i = 0; i < graph.nodes.size(); ++i) poses[graph.nodes[i].key] = solution.poses[i];
  poses.erase(kOriginKey);
  if (file.is_g2o) {
    file.g2o.vertices.clear();
    for (const auto& [key, pose] : poses) file.g2o.vertices.push_back({key.index, pose});
    return WriteG2o(file.g2o, out);
  }
  for (GraphNode& node : file.pyfg.graph.nodes) node.map_from_node = poses.at(node.key);
  for (PyfgLandmark& landmark : file.pyfg.landmarks) landmark.position_m = poses.at(landmark.key).position_m;
  return WritePyfg(file.pyfg, out);
}

ExitCode SolveFile(CommandContext& context, const SolveArguments& arguments) {
  auto file = ReadInput(arguments);
  if (!file) return context.Report(file.error());
  const auto graph = ToPlain(*file, arguments.fixed);
  if (!graph) return context.Report(graph.error());
  PlainOptions options;
  options.thread_count = arguments.threads;
  const auto begin = std::chrono::steady_clock::now();
  const PlainSolution solution =
      arguments.starts_at_vertices ? SolveFromVertices(*graph, options) : SolveStandaloneGraph(*graph, options);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  if (!solution.has_converged) {
    return context.Report(Error{ErrorCode::kInternal, "no solution: " + solution.text, arguments.input.files.front()});
  }
  if (!arguments.out.empty()) {
    if (auto written = WriteSolved(*file, *graph, solution, arguments.out); !written) {
      return context.Report(written.error());
    }
  }
  const std::size_t priors = file->pyfg.graph.priors.size() + file->g2o.priors.size();
  const std::size_t nodes = graph->nodes.size() - (priors > 0 ? 1 : 0);  // Without the origin.
  const std::size_t edges = graph->steps.size() + graph->sightings.size() - priors;
  JsonWriter json;
  json.BeginObject().Key("nodes").Number(static_cast<double>(nodes));
  json.Key("edges").Number(static_cast<double>(edges));
  json.Key("ranges").Number(static_cast<double>(graph->ranges.size()));
  json.Key("priors").Number(static_cast<double>(priors));
  json.Key("cost").Number(solution.cost).Key("initialisation").String(ToString(solution.initial_values));
  json.Key("iterations").Number(solution.iterations).Key("seconds").Number(seconds);
  json.Key("text").String(solution.text).EndObject();
  std::string text = std::to_string(nodes) + " nodes, " + FormatCount(static_cast<double>(edges), "edge") + ", " +
                     std::to_string(graph->ranges.size()) + " ranges" +
                     (priors > 0 ? ", " + FormatCount(static_cast<double>(priors), "prior") : "") + "\ncost " +
                     FormatDouble(solution.cost) + " after " + FormatCount(solution.iterations, "iteration") + ", " +
                     FormatFixed(seconds, 3) + " s; started from: " + ToString(solution.initial_values);
  if (!solution.text.empty()) text += "\n" + solution.text;
  if (!arguments.out.empty()) text += "\nwrote " + arguments.out;
  return context.Done(json.text(), text);
}

}  // namespace

void AddGraphSolve(Command& group, CommandContext& context) {
  auto arguments = std::make_shared<SolveArguments>();
  Command& command = AddCommand(group, "solve", "Solve a graph file with all its factors, without an agent",
                                {"moonctl graph solve plaza.pyfg --fix L0 --out solved.pyfg"});
  AddGraphFileOptions(command, arguments->input);
  command.AddOption("--out", arguments->out, "Write the graph with the solved poses").TypeName("FILE");
  command.AddOption("--fix", arguments->fixed, "Vertex to hold fixed at its position in the file (L0, or a g2o id)");
  command.AddFlag("--vertices-as-start", arguments->starts_at_vertices,
                  "Start from the file's vertices. By default they are ignored, since they are often the ground truth");
  command.AddFlag("--isotropic", arguments->is_isotropic,
                  "Accept information matrices that are not positive definite: use the trace of each block");
  command.AddOption("--threads", arguments->threads, "Number of threads of the solver").Within(1, 64);
  command.Callback(
      [&context, arguments] { context.action = [&context, arguments] { return SolveFile(context, *arguments); }; });
}

}  // namespace moondb
