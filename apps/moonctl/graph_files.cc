#include "apps/moonctl/graph_files.h"

#include <algorithm>
#include <filesystem>

#include "apps/moonctl/exit_code.h"
#include "model/text.h"

namespace moondb {
namespace {

constexpr char kEdgeSigmas[] = "--edge-sigmas";
// The square roots of kVarianceMin and kVarianceMax (model/pose_graph.h).
constexpr double kSigmaMin = 1e-6;
constexpr double kSigmaMax = 1e4;

Result<EdgeSigmas> ParseEdgeSigmas(const std::string& text) {
  std::vector<double> sigmas;
  for (const std::string_view part : Split(text, ',')) {
    const double sigma = ParseDouble(part).value_or(0);
    if (sigma >= kSigmaMin && sigma <= kSigmaMax) sigmas.push_back(sigma);
  }
  if (sigmas.size() == 2 && std::count(text.begin(), text.end(), ',') == 1) return EdgeSigmas{sigmas[0], sigmas[1]};
  return Fail(ErrorCode::kInvalid,
              "'" + text + "' must be two numbers from 1e-6 to 1e4, in m and rad, with a comma between them: 0.1,0.05",
              kEdgeSigmas);
}

}  // namespace

void AddGraphFileOptions(Command& command, GraphFileArguments& arguments) {
  command.AddOption("file", arguments.files, "A PyFG file, or all .g2o files of one graph, such as one for each robot")
      .TypeName("FILE")
      .Required();
  command
      .AddOption(kEdgeSigmas, arguments.edge_sigmas,
                 "For g2o edges without an information matrix: standard deviations of position (m) and rotation (rad)")
      .TypeName("M,RAD");
}

bool IsG2o(const std::string& file) { return std::filesystem::path(file).extension() == ".g2o"; }

Result<GraphFile> ReadGraphFile(const GraphFileArguments& arguments, InformationCheck check) {
  GraphFile graph;
  graph.is_g2o = std::all_of(arguments.files.begin(), arguments.files.end(), IsG2o);
  if (!graph.is_g2o) {
    if (!arguments.edge_sigmas.empty()) return Fail(ErrorCode::kInvalid, "applies only to .g2o files", kEdgeSigmas);
    if (arguments.files.size() > 1) {
      return Fail(ErrorCode::kInvalid, "several files of one graph must all be .g2o files", "file");
    }
    auto pyfg = ReadPyfg(arguments.files.front());
    if (!pyfg) return tl::unexpected(InputError(pyfg.error()));
    graph.pyfg = *std::move(pyfg);
    return graph;
  }
  G2oOptions options{.check = check};
  if (!arguments.edge_sigmas.empty()) {
    const Result<EdgeSigmas> sigmas = ParseEdgeSigmas(arguments.edge_sigmas);
    if (!sigmas) return tl::unexpected(sigmas.error());
    options.edge_sigmas = *sigmas;
  }
  auto g2o = ReadG2oFiles(arguments.files, options);
  if (!g2o) return tl::unexpected(InputError(g2o.error()));
  graph.g2o = *std::move(g2o);
  return graph;
}

}  // namespace moondb
