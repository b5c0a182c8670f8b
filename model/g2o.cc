#include "model/g2o.h"

#include <Eigen/LU>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "model/g2o_id.h"
#include "model/line_fields.h"
#include "model/text.h"

namespace moondb {

namespace {

std::string EdgeText(const G2oEdge& edge, bool is_planar);

class G2oParser {
 public:
  explicit G2oParser(const G2oOptions& options) : options_(options) {}

  // Parses one file of the graph.
  Result<void> Parse(TextLines lines, std::string name) {
    g2o_.files.push_back(std::move(name));
    return ParseLines(std::move(lines), g2o_.files.back(), [this](LineFields& fields, std::size_t line) {
      place_ = {g2o_.files.size() - 1, line};
      ParseLine(fields);
    });
  }

  // Checks the references between the lines, and returns the graph. Call it after the last file.
  Result<G2o> Finish() {
    // A graph without vertex lines defines its vertices by its edges.
    if (vertices_.empty()) {
      for (const G2oEdge& edge : g2o_.edges) vertices_.insert({{edge.from, 0}, {edge.to, 0}});
    }
    for (const Mention& mention : mentions_) {
      if (vertices_.contains(mention.id)) continue;
      return Fail(ErrorCode::kInvalid,
                  "vertex " + NameOfId(mention.id) +
                      " is in no vertex line: give all files of the graph, such as moonctl graph import 0.g2o 1.g2o",
                  PlaceText(g2o_, mention.place));
    }
    if (g2o_.files.size() > 1) DropRepeatedEdges();
    return std::move(g2o_);
  }

 private:
  // A reference to a vertex, which may be defined on a later line.
  struct Mention {
    std::uint64_t id = 0;
    G2oPlace place;
  };

  void ParseLine(LineFields& fields) {
    const std::string_view word = fields.Take();
    if (word == "VERTEX_SE2") return ParseVertex(fields, true);
    if (word == "VERTEX_SE3:QUAT") return ParseVertex(fields, false);
    if (word == "EDGE_SE2") return ParseEdge(fields, true);
    if (word == "EDGE_SE3:QUAT") return ParseEdge(fields, false);
    if (word == "EDGE_PRIOR_SE2") return ParsePrior(fields, true, PriorExtent::kPose);
    if (word == "EDGE_PRIOR_SE2_XY") return ParsePrior(fields, true, PriorExtent::kPosition);
    if (word == "EDGE_SE3_PRIOR") return ParsePrior(fields, false, PriorExtent::kPose);
    if (word == "EDGE_SE3_XYZ_PRIOR") return ParsePrior(fields, false, PriorExtent::kPosition);
    if (word == "PARAMS_SE3OFFSET") return ParseOffset(fields);
    if (word == "FIX") return ParseFix(fields);
    fields.Stop(KeywordError(word, fields));
  }

  static std::string KeywordError(std::string_view word, const LineFields& fields) {
    const std::string joined = std::string(word) + std::string(fields.Peek(0)) + std::string(fields.Peek(1));
    for (const char* keyword : {"VERTEX_SE3:QUAT", "EDGE_SE3:QUAT"}) {
      if (joined.starts_with(keyword)) return "a blank within '" + std::string(keyword) + "': write it as one word";
    }
    return "'" + std::string(word) + "' is not a known keyword of g2o";
  }

  void ParseVertex(LineFields& fields, bool is_planar) {
    UseDimension(fields, is_planar);
    G2oVertex vertex;
    vertex.id = fields.Index();
    vertex.map_from_vertex = fields.PoseOf(is_planar);
    vertex.place = place_;
    if (!fields.error().empty()) return;
    const auto [known, is_new] = vertices_.emplace(vertex.id, place_.file);
    if (!is_new) fields.Stop(RepetitionError(vertex.id, known->second));
    g2o_.vertices.push_back(vertex);
  }

  std::string RepetitionError(std::uint64_t id, std::size_t file) const {
    if (file == place_.file) return "the vertex " + NameOfId(id) + " occurs a second time";
    const std::string text = "the vertex " + NameOfId(id) + " is also in " + g2o_.files[file];
    return id > kPlainIdMax ? text : text + ": import files with plain ids one by one, each with -a";
  }

  void ParseEdge(LineFields& fields, bool is_planar) {
    UseDimension(fields, is_planar);
    G2oEdge edge;
    edge.from = Mentioned(fields);
    edge.to = Mentioned(fields);
    if (fields.error().empty() && edge.from == edge.to) fields.Stop("the edge joins a vertex with itself");
    edge.from_from_to = fields.PoseOf(is_planar);
    const bool has_information = fields.left() > 0 || !fields.error().empty();
    edge.information =
        has_information ? PoseInformation(fields, is_planar) : MissingInformation(fields, edge, is_planar);
    edge.place = place_;
    g2o_.edges.push_back(edge);
  }

  // Returns the information matrix of an edge that has none.
  Matrix6d MissingInformation(LineFields& fields, const G2oEdge& edge, bool is_planar) const {
    if (!options_.edge_sigmas) {
      fields.Stop((is_planar ? "EDGE_SE2 " : "EDGE_SE3:QUAT ") + std::to_string(edge.from) + " " +
                  std::to_string(edge.to) + " has no information matrix (" + (is_planar ? "6" : "21") +
                  " numbers): --edge-sigmas M,RAD gives one to all such edges");
      return Matrix6d::Identity();
    }
    const double position = 1 / (options_.edge_sigmas->position_m * options_.edge_sigmas->position_m);
    const double rotation = 1 / (options_.edge_sigmas->rotation_rad * options_.edge_sigmas->rotation_rad);
    Matrix6d information = Matrix6d::Identity();
    if (is_planar) {
      SetPlanar(Eigen::Vector3d(position, position, rotation).asDiagonal(), information);
    } else {
      information.diagonal() << position, position, position, rotation, rotation, rotation;
    }
    return information;
  }

  void ParseOffset(LineFields& fields) {
    offsets_.insert(fields.Index());
    const Pose offset = fields.PoseOf(/*is_planar=*/false);
    const bool is_identity = offset.position_m.isZero(0) && std::abs(offset.orientation.w()) == 1;
    if (!is_identity)
      fields.Stop(
          "only the identity is supported as an offset of a sensor: give the measurements in the frame of the robot");
  }

  void ParsePrior(LineFields& fields, bool is_planar, PriorExtent extent) {
    UseDimension(fields, is_planar);
    G2oPrior prior;
    prior.extent = extent;
    prior.id = Mentioned(fields);
    if (!is_planar) ParseOffsetId(fields, prior.id);
    if (extent == PriorExtent::kPose) {
      prior.map_from_vertex = fields.PoseOf(is_planar);
      prior.information = PoseInformation(fields, is_planar);
    } else {
      prior.map_from_vertex.position_m = fields.Position(is_planar);
      prior.information.topLeftCorner<3, 3>() = fields.PositionMatrix(is_planar, "information");
    }
    g2o_.priors.push_back(prior);
  }

  // Reads the id of a prior's offset. RTAB-Map repeats the id of the vertex instead, without a line that defines it.
  void ParseOffsetId(LineFields& fields, std::uint64_t vertex) const {
    const std::uint64_t id = fields.Index();
    if (id == vertex || offsets_.contains(id)) return;
    const std::string number = std::to_string(id);
    fields.Stop("no line above defines the parameter " + number + ": add PARAMS_SE3OFFSET " + number +
                " 0 0 0 0 0 0 1");
  }

  Matrix6d PoseInformation(LineFields& fields, bool is_planar) const {
    const std::size_t count = is_planar ? 6 : 21;
    if (fields.left() < count) {
      fields.Stop("the information matrix has " + std::to_string(fields.left()) + " numbers, not " +
                  std::to_string(count));
    }
    if (!is_planar) return InformationOf<6, 3>(fields);
    Matrix6d information = Matrix6d::Identity();
    SetPlanar(InformationOf<3, 2>(fields), information);
    return information;
  }

  // Reads an information matrix of kSize rows. The first kTranslation rows belong to the translation.
  template <int kSize, int kTranslation>
  Eigen::Matrix<double, kSize, kSize> InformationOf(LineFields& fields) const {
    constexpr const char* kName = "information";
    if (options_.check == InformationCheck::kPositiveDefinite) return fields.PositiveDefinite<kSize>(kName);
    constexpr int kRotation = kSize - kTranslation;
    const Eigen::Matrix<double, kSize, kSize> matrix = fields.Symmetric<kSize>();
    const Eigen::Matrix<double, kTranslation, kTranslation> translation =
        matrix.template topLeftCorner<kTranslation, kTranslation>().inverse();
    const Eigen::Matrix<double, kRotation, kRotation> rotation =
        matrix.template bottomRightCorner<kRotation, kRotation>().inverse();
    const auto has_weight = [](double trace) { return std::isfinite(trace) && trace > 0; };
    if (!has_weight(translation.trace())) fields.Stop("the translation's information has no inverse of positive trace");
    if (!has_weight(rotation.trace())) fields.Stop("the rotation's information has no inverse of positive trace");
    return matrix;
  }

  void ParseFix(LineFields& fields) {
    do g2o_.fixed.push_back(Mentioned(fields));
    while (fields.error().empty() && fields.left() > 0);
  }

  std::uint64_t Mentioned(LineFields& fields) {
    const std::uint64_t id = fields.Index();
    mentions_.push_back({id, place_});
    return id;
  }

  void UseDimension(LineFields& fields, bool is_planar) {
    if (has_dimension_ && g2o_.is_planar != is_planar) fields.Stop("2-D and 3-D are mixed in one file");
    has_dimension_ = true;
    g2o_.is_planar = is_planar;
  }

  // Keeps the first of equal edges in different files. The files of two robots may both have the edges between them.
  void DropRepeatedEdges() {
    std::map<std::string, std::size_t> file_of;
    std::erase_if(g2o_.edges, [&](const G2oEdge& edge) {
      const auto [first, is_new] = file_of.emplace(EdgeText(edge, g2o_.is_planar), edge.place.file);
      return first->second != edge.place.file;
    });
  }

  const G2oOptions options_;
  G2oPlace place_;  // The current line.
  bool has_dimension_ = false;
  G2o g2o_;
  std::map<std::uint64_t, std::size_t> vertices_;  // The file of each vertex, by its id.
  std::set<std::uint64_t> offsets_;
  std::vector<Mention> mentions_;
};

std::string PositionText(const Eigen::Vector3d& position_m, bool is_planar) {
  std::string text;
  for (int i = 0; i < (is_planar ? 2 : 3); ++i) text += " " + FormatDouble(position_m[i]);
  return text;
}

std::string PoseText(const Pose& pose, bool is_planar) {
  std::string text = PositionText(pose.position_m, is_planar);
  const auto add = [&text](double value) { text += " " + FormatDouble(value); };
  if (is_planar) {
    add(ExactPlanarYaw(pose.orientation));
  } else {
    for (const double value : pose.orientation.coeffs()) add(value);
  }
  return text;
}

std::string InformationText(const Matrix6d& information, bool is_planar) {
  std::string text;
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) {
      const auto is_spatial_only = [](int axis) { return axis >= 2 && axis <= 4; };
      if (is_planar && (is_spatial_only(row) || is_spatial_only(column))) continue;
      text += " " + FormatDouble(information(row, column));
    }
  }
  return text;
}

std::string EdgeText(const G2oEdge& edge, bool is_planar) {
  return (is_planar ? "EDGE_SE2 " : "EDGE_SE3:QUAT ") + std::to_string(edge.from) + " " + std::to_string(edge.to) +
         PoseText(edge.from_from_to, is_planar) + InformationText(edge.information, is_planar) + "\n";
}

std::string PriorText(const G2oPrior& prior, bool is_planar) {
  const std::string id = std::to_string(prior.id) + (is_planar ? "" : " 0");
  if (prior.extent == PriorExtent::kPose) {
    return (is_planar ? "EDGE_PRIOR_SE2 " : "EDGE_SE3_PRIOR ") + id + PoseText(prior.map_from_vertex, is_planar) +
           InformationText(prior.information, is_planar) + "\n";
  }
  std::string text = (is_planar ? "EDGE_PRIOR_SE2_XY " : "EDGE_SE3_XYZ_PRIOR ") + id +
                     PositionText(prior.map_from_vertex.position_m, is_planar);
  const int size = is_planar ? 2 : 3;
  for (int row = 0; row < size; ++row) {
    for (int column = row; column < size; ++column) text += " " + FormatDouble(prior.information(row, column));
  }
  return text + "\n";
}

}  // namespace

Result<G2o> ParseG2o(std::string_view text, const std::string& name, const G2oOptions& options) {
  G2oParser parser(options);
  if (auto parsed = parser.Parse(TextLines(text), name); !parsed) return tl::unexpected(parsed.error());
  return parser.Finish();
}

Result<G2o> ReadG2o(const std::filesystem::path& file, const G2oOptions& options) {
  return ReadG2oFiles({file.string()}, options);
}

Result<G2o> ReadG2oFiles(const std::vector<std::string>& files, const G2oOptions& options) {
  G2oParser parser(options);
  for (const std::string& file : files) {
    Result<TextLines> lines = TextLines::OfFile(file);
    if (!lines) return tl::unexpected(lines.error());
    if (auto parsed = parser.Parse(*std::move(lines), file); !parsed) return tl::unexpected(parsed.error());
  }
  return parser.Finish();
}

std::string PlaceText(const G2o& g2o, const G2oPlace& place) {
  return place.file < g2o.files.size() ? FileLine(g2o.files[place.file], place.line) : "";
}

std::string FormatG2o(const G2o& g2o) {
  std::string text;
  for (const G2oVertex& vertex : g2o.vertices) {
    text += (g2o.is_planar ? "VERTEX_SE2 " : "VERTEX_SE3:QUAT ") + std::to_string(vertex.id) +
            PoseText(vertex.map_from_vertex, g2o.is_planar) + "\n";
  }
  for (const std::uint64_t id : g2o.fixed) text += "FIX " + std::to_string(id) + "\n";
  for (const G2oEdge& edge : g2o.edges) text += EdgeText(edge, g2o.is_planar);
  if (!g2o.is_planar && !g2o.priors.empty()) text += "PARAMS_SE3OFFSET 0 0 0 0 0 0 0 1\n";
  for (const G2oPrior& prior : g2o.priors) text += PriorText(prior, g2o.is_planar);
  return text;
}

Result<void> WriteG2o(const G2o& g2o, const std::filesystem::path& file) { return WriteTextFile(file, FormatG2o(g2o)); }

}  // namespace moondb
