#include "model/g2o.h"

#include <Eigen/LU>
#include <cmath>
#include <set>
#include <utility>

#include "model/line_fields.h"
#include "model/text.h"

namespace moondb {

namespace {

class G2oParser {
 public:
  G2oParser(std::string name, InformationCheck check) : name_(std::move(name)), check_(check) {}

  Result<G2o> Parse(TextLines lines) {
    const Result<void> parsed = ParseLines(std::move(lines), name_, [this](LineFields& fields, std::size_t line) {
      line_ = line;
      ParseLine(fields);
    });
    if (!parsed) return tl::unexpected(parsed.error());
    // A file without vertex lines defines its vertices by its edges.
    if (vertices_.empty()) {
      for (const G2oEdge& edge : g2o_.edges) vertices_.insert({edge.from, edge.to});
    }
    for (const Mention& mention : mentions_) {
      if (!vertices_.contains(mention.id)) {
        return Stop(mention.line, "no vertex has the id " + std::to_string(mention.id));
      }
    }
    return std::move(g2o_);
  }

 private:
  // A reference to a vertex, which may be defined on a later line.
  struct Mention {
    std::uint64_t id = 0;
    std::size_t line = 0;
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
    fields.Stop("'" + std::string(word) + "' is not a known keyword of g2o");
  }

  void ParseVertex(LineFields& fields, bool is_planar) {
    UseDimension(fields, is_planar);
    G2oVertex vertex;
    vertex.id = fields.Index();
    vertex.map_from_vertex = fields.PoseOf(is_planar);
    if (!fields.error().empty()) return;
    if (!vertices_.insert(vertex.id).second) {
      fields.Stop("the vertex " + std::to_string(vertex.id) + " occurs a second time");
    }
    g2o_.vertices.push_back(vertex);
  }

  void ParseEdge(LineFields& fields, bool is_planar) {
    UseDimension(fields, is_planar);
    G2oEdge edge;
    edge.from = Mentioned(fields);
    edge.to = Mentioned(fields);
    if (fields.error().empty() && edge.from == edge.to) fields.Stop("the edge joins a vertex with itself");
    edge.from_from_to = fields.PoseOf(is_planar);
    if (is_planar) {
      SetPlanar(InformationOf<3, 2>(fields), edge.information);
    } else {
      edge.information = InformationOf<6, 3>(fields);
    }
    g2o_.edges.push_back(edge);
  }

  void ParseOffset(LineFields& fields) {
    offsets_.insert(fields.Index());
    const Pose offset = fields.PoseOf(/*is_planar=*/false);
    const bool is_identity = offset.position_m.isZero(0) && std::abs(offset.orientation.w()) == 1;
    if (!is_identity) fields.Stop("the offset is not the identity");
  }

  void ParsePrior(LineFields& fields, bool is_planar, PriorExtent extent) {
    UseDimension(fields, is_planar);
    G2oPrior prior;
    prior.extent = extent;
    prior.id = Mentioned(fields);
    if (!is_planar && !offsets_.contains(fields.Index())) fields.Stop("the offset is defined on no earlier line");
    if (extent == PriorExtent::kPose) {
      prior.map_from_vertex = fields.PoseOf(is_planar);
      if (is_planar) {
        SetPlanar(InformationOf<3, 2>(fields), prior.information);
      } else {
        prior.information = InformationOf<6, 3>(fields);
      }
    } else {
      prior.map_from_vertex.position_m = fields.Position(is_planar);
      prior.information.topLeftCorner<3, 3>() = fields.PositionMatrix(is_planar, "information");
    }
    g2o_.priors.push_back(prior);
  }

  // Reads an information matrix of kSize rows. The first kTranslation rows belong to the translation.
  template <int kSize, int kTranslation>
  Eigen::Matrix<double, kSize, kSize> InformationOf(LineFields& fields) const {
    constexpr const char* kName = "information";
    if (check_ == InformationCheck::kPositiveDefinite) return fields.PositiveDefinite<kSize>(kName);
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
    mentions_.push_back({id, line_});
    return id;
  }

  void UseDimension(LineFields& fields, bool is_planar) {
    if (has_dimension_ && g2o_.is_planar != is_planar) fields.Stop("2-D and 3-D are mixed in one file");
    has_dimension_ = true;
    g2o_.is_planar = is_planar;
  }

  tl::unexpected<Error> Stop(std::size_t line, std::string text) const {
    return Fail(ErrorCode::kInvalid, std::move(text), FileLine(name_, line));
  }

  std::string name_;
  InformationCheck check_;
  std::size_t line_ = 0;
  bool has_dimension_ = false;
  G2o g2o_;
  std::set<std::uint64_t> vertices_;
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

Result<G2o> ParseG2o(std::string_view text, const std::string& name, InformationCheck check) {
  return G2oParser(name, check).Parse(TextLines(text));
}

Result<G2o> ReadG2o(const std::filesystem::path& file, InformationCheck check) {
  Result<TextLines> lines = TextLines::OfFile(file);
  if (!lines) return tl::unexpected(lines.error());
  return G2oParser(file.string(), check).Parse(*std::move(lines));
}

std::string FormatG2o(const G2o& g2o) {
  std::string text;
  for (const G2oVertex& vertex : g2o.vertices) {
    text += (g2o.is_planar ? "VERTEX_SE2 " : "VERTEX_SE3:QUAT ") + std::to_string(vertex.id) +
            PoseText(vertex.map_from_vertex, g2o.is_planar) + "\n";
  }
  for (const std::uint64_t id : g2o.fixed) text += "FIX " + std::to_string(id) + "\n";
  for (const G2oEdge& edge : g2o.edges) {
    text += (g2o.is_planar ? "EDGE_SE2 " : "EDGE_SE3:QUAT ") + std::to_string(edge.from) + " " +
            std::to_string(edge.to) + PoseText(edge.from_from_to, g2o.is_planar) +
            InformationText(edge.information, g2o.is_planar) + "\n";
  }
  if (!g2o.is_planar && !g2o.priors.empty()) text += "PARAMS_SE3OFFSET 0 0 0 0 0 0 0 1\n";
  for (const G2oPrior& prior : g2o.priors) text += PriorText(prior, g2o.is_planar);
  return text;
}

Result<void> WriteG2o(const G2o& g2o, const std::filesystem::path& file) { return WriteTextFile(file, FormatG2o(g2o)); }

}  // namespace moondb
