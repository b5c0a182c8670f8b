#include "model/pyfg.h"

#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "model/check.h"
#include "model/line_fields.h"
#include "model/text.h"

namespace moondb {

namespace {

constexpr int kLetters = 26;

enum class VertexKind { kPose, kLandmark };

// The keys that an edge or prior names. Both are equal for a prior.
struct EdgeEnds {
  NodeKey from;
  NodeKey to;
  std::size_t line = 0;
  bool is_to_landmark = false;
  bool is_of_any = false;  // True if poses and landmarks are allowed.
  bool is_prior = false;
};

NodeKey TakeKey(LineFields& fields) {
  const std::string_view text = fields.Take();
  const std::optional<NodeKey> key = ParseKey(text);
  if (!key) fields.Stop("'" + std::string(text) + "' is not a key (a letter and a number)");
  return key.value_or(NodeKey{});
}

Matrix6d Lift(const Eigen::Matrix3d& planar) {
  Matrix6d covariance = Matrix6d::Identity();
  SetPlanar(planar, covariance);
  return covariance;
}

// The covariance of a planar pose (x, y, yaw) within that of a position and a yaw (x, y, z, yaw).
constexpr int kPlanarPlaces[] = {0, 1, 3};

void SetPositionYaw(const Eigen::Matrix3d& planar, Matrix6d& covariance) {
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      covariance(kPlanarPlaces[row], kPlanarPlaces[column]) = planar(row, column);
    }
  }
}

class PyfgParser {
 public:
  explicit PyfgParser(std::string name) : name_(std::move(name)) {}

  Result<Pyfg> Parse(TextLines lines) {
    const Result<void> parsed = ParseLines(std::move(lines), name_, [this](LineFields& fields, std::size_t line) {
      line_ = line;
      ParseLine(fields);
    });
    if (!parsed) return tl::unexpected(parsed.error());
    return CheckEdges();
  }

 private:
  void ParseLine(LineFields& fields) {
    const std::string_view word = fields.Take();
    if (word == "VERTEX_SE2") return ParsePose(fields, true);
    if (word == "VERTEX_SE3:QUAT") return ParsePose(fields, false);
    if (word == "VERTEX_XY") return ParseLandmark(fields, true);
    if (word == "VERTEX_XYZ") return ParseLandmark(fields, false);
    if (word == "EDGE_SE2") return ParseOdometry(fields, true);
    if (word == "EDGE_SE3:QUAT") return ParseOdometry(fields, false);
    if (word == "EDGE_SE2_XY") return ParseSighting(fields, true);
    if (word == "EDGE_SE3_XYZ") return ParseSighting(fields, false);
    if (word == "EDGE_RANGE") return ParseRange(fields);
    if (word == "VERTEX_SE2:PRIOR") return ParsePosePrior(fields, true);
    if (word == "VERTEX_SE3:QUAT:PRIOR") return ParsePosePrior(fields, false);
    if (word == "VERTEX_XY:PRIOR") return ParsePositionPrior(fields, true);
    if (word == "VERTEX_XYZ:PRIOR") return ParsePositionPrior(fields, false);
    fields.Stop("'" + std::string(word) + "' is not a keyword of PyFG");
  }

  void ParsePose(LineFields& fields, bool is_planar) {
    UseDimension(fields, is_planar);
    GraphNode node;
    node.timestamp_ns = fields.Timestamp();
    node.key = TakeKey(fields);
    node.map_from_node = fields.PoseOf(is_planar);
    AddVertex(fields, node.key, VertexKind::kPose);
    pyfg_.graph.nodes.push_back(node);
  }

  void ParseLandmark(LineFields& fields, bool is_planar) {
    UseDimension(fields, is_planar);
    PyfgLandmark landmark;
    const std::size_t fields_without_timestamp = is_planar ? 3 : 4;
    if (fields.left() > fields_without_timestamp) landmark.timestamp_ns = fields.Timestamp();
    landmark.key = TakeKey(fields);
    landmark.position_m = fields.Position(is_planar);
    AddVertex(fields, landmark.key, VertexKind::kLandmark);
    pyfg_.landmarks.push_back(landmark);
  }

  void ParseOdometry(LineFields& fields, bool is_planar) {
    UseDimension(fields, is_planar);
    OdometryEdge edge;
    edge.timestamp_ns = fields.Timestamp();
    edge.from = TakeKey(fields);
    edge.to = TakeKey(fields);
    edge.from_from_to = fields.PoseOf(is_planar);
    edge.covariance =
        is_planar ? Lift(fields.PositiveDefinite<3>("covariance")) : fields.PositiveDefinite<6>("covariance");
    edges_.push_back({edge.from, edge.to, line_});
    pyfg_.graph.odometry.push_back(edge);
  }

  void ParseSighting(LineFields& fields, bool is_planar) {
    UseDimension(fields, is_planar);
    PyfgSighting sighting;
    sighting.timestamp_ns = fields.Timestamp();
    sighting.from = TakeKey(fields);
    sighting.to = TakeKey(fields);
    sighting.from_point_m = fields.Position(is_planar);
    sighting.covariance = fields.PositionMatrix(is_planar, "covariance");
    edges_.push_back({sighting.from, sighting.to, line_, /*is_to_landmark=*/true});
    pyfg_.sightings.push_back(sighting);
  }

  void ParseRange(LineFields& fields) {
    RangeEdge edge;
    edge.timestamp_ns = fields.Timestamp();
    edge.from = TakeKey(fields);
    edge.to = TakeKey(fields);
    edge.range_m = fields.Number();
    edge.variance_m2 = fields.Number();
    if (edge.range_m < 0 || edge.range_m > kRangeMax_m) fields.Stop("the range must lie between 0 and 1e6 m");
    if (edge.variance_m2 <= 0) fields.Stop("the variance must be positive");
    edges_.push_back({edge.from, edge.to, line_, false, /*is_of_any=*/true});
    pyfg_.graph.ranges.push_back(edge);
  }

  void ParsePosePrior(LineFields& fields, bool is_planar) {
    UseDimension(fields, is_planar);
    NodePrior prior;
    prior.timestamp_ns = fields.Timestamp();
    prior.node = TakeKey(fields);
    prior.map_from_node = fields.PoseOf(is_planar);
    if (is_planar) {
      prior.extent = PriorExtent::kPositionYaw;
      SetPositionYaw(fields.PositiveDefinite<3>("covariance"), prior.covariance);
    } else {
      prior.covariance = fields.PositiveDefinite<6>("covariance");
    }
    edges_.push_back({prior.node, prior.node, line_, false, false, /*is_prior=*/true});
    pyfg_.graph.priors.push_back(prior);
  }

  void ParsePositionPrior(LineFields& fields, bool is_planar) {
    UseDimension(fields, is_planar);
    NodePrior prior;
    prior.extent = PriorExtent::kPosition;
    prior.timestamp_ns = fields.Timestamp();
    prior.node = TakeKey(fields);
    prior.map_from_node.position_m = fields.Position(is_planar);
    prior.covariance.topLeftCorner<3, 3>() = fields.PositionMatrix(is_planar, "covariance");
    edges_.push_back({prior.node, prior.node, line_, false, /*is_of_any=*/true, /*is_prior=*/true});
    pyfg_.graph.priors.push_back(prior);
  }

  void UseDimension(LineFields& fields, bool is_planar) {
    if (has_dimension_ && pyfg_.is_planar != is_planar) fields.Stop("2-D and 3-D are mixed in one file");
    has_dimension_ = true;
    pyfg_.is_planar = is_planar;
  }

  void AddVertex(LineFields& fields, NodeKey key, VertexKind kind) {
    if (!fields.error().empty()) return;
    if (!vertices_.emplace(key, kind).second) fields.Stop("the vertex " + FormatKey(key) + " occurs a second time");
  }

  // Checks that the ends of all edges exist. Call it after the last line, because edges may precede their vertices.
  Result<Pyfg> CheckEdges() {
    for (const EdgeEnds& edge : edges_) {
      if (edge.from == edge.to && !edge.is_prior)
        return Stop(edge.line, "the edge joins " + FormatKey(edge.from) + " with itself");
      for (const NodeKey end : {edge.from, edge.to}) {
        const auto vertex = vertices_.find(end);
        if (vertex == vertices_.end()) return Stop(edge.line, "no vertex has the key " + FormatKey(end));
        if (edge.is_of_any) continue;
        const bool is_landmark = vertex->second == VertexKind::kLandmark;
        if (is_landmark != (edge.is_to_landmark && end == edge.to)) {
          return Stop(edge.line, FormatKey(end) + (is_landmark ? " is a landmark" : " is not a landmark"));
        }
      }
    }
    return std::move(pyfg_);
  }

  tl::unexpected<Error> Stop(std::size_t line, std::string text) const {
    return Fail(ErrorCode::kInvalid, std::move(text), FileLine(name_, line));
  }

  std::string name_;
  std::size_t line_ = 0;
  bool has_dimension_ = false;
  Pyfg pyfg_;
  std::map<NodeKey, VertexKind> vertices_;
  std::vector<EdgeEnds> edges_;
};

class Formatter {
 public:
  explicit Formatter(bool is_planar) : is_planar_(is_planar) {}

  Formatter& Word(std::string_view word) {
    if (!text_.empty() && text_.back() != '\n') text_ += ' ';
    text_ += word;
    return *this;
  }
  // Appends one of the two keywords: `planar` in a 2-D file, `spatial` in a 3-D file.
  Formatter& Word(std::string_view planar, std::string_view spatial) { return Word(is_planar_ ? planar : spatial); }
  Formatter& Number(double value) { return Word(FormatDouble(value)); }
  Formatter& Timestamp(std::int64_t timestamp_ns) { return Word(FormatTimestampNs(timestamp_ns)); }
  Formatter& Key(NodeKey key) {
    Check(LetterOfAgent(key.agent) != '?', "PyFG names agents 1 to 52 by a letter");
    return Word(FormatKey(key));
  }
  Formatter& Position(const Eigen::Vector3d& position) {
    for (int i = 0; i < (is_planar_ ? 2 : 3); ++i) Number(position[i]);
    return *this;
  }
  Formatter& PoseOf(const Pose& pose) {
    Position(pose.position_m);
    const Eigen::Quaterniond& q = pose.orientation;
    if (is_planar_) return Number(ExactPlanarYaw(q));
    return Number(q.x()).Number(q.y()).Number(q.z()).Number(q.w());
  }
  template <typename Matrix>
  Formatter& UpperTriangle(const Matrix& covariance, int size) {
    for (int row = 0; row < size; ++row) {
      for (int column = row; column < size; ++column) Number(covariance(row, column));
    }
    return *this;
  }
  void End() { text_ += '\n'; }
  std::string Take() { return std::move(text_); }

 private:
  bool is_planar_;
  std::string text_;
};

// `edge` is an OdometryEdge or a LoopClosure.
template <typename Edge>
void FormatRelativePose(const Edge& edge, bool is_planar, Formatter& out) {
  out.Word("EDGE_SE2", "EDGE_SE3:QUAT")
      .Timestamp(edge.timestamp_ns)
      .Key(edge.from)
      .Key(edge.to)
      .PoseOf(edge.from_from_to);
  if (is_planar) {
    out.UpperTriangle(PlanarOf(edge.covariance), 3);
  } else {
    out.UpperTriangle(edge.covariance, 6);
  }
  out.End();
}

void FormatPrior(const NodePrior& measured, bool is_planar, Formatter& out) {
  Check(measured.point_m.isZero(0), "PyFG has no prior of another point than the origin");
  const NodePrior prior = WithTilt(measured);
  if (prior.extent == PriorExtent::kPosition) {
    out.Word("VERTEX_XY:PRIOR", "VERTEX_XYZ:PRIOR").Timestamp(prior.timestamp_ns).Key(prior.node);
    out.Position(prior.map_from_node.position_m).UpperTriangle(prior.covariance, is_planar ? 2 : 3).End();
    return;
  }
  out.Word("VERTEX_SE2:PRIOR", "VERTEX_SE3:QUAT:PRIOR").Timestamp(prior.timestamp_ns).Key(prior.node);
  out.PoseOf(prior.map_from_node);
  if (is_planar) {
    out.UpperTriangle(PlanarOf(prior.covariance), 3);
  } else {
    out.UpperTriangle(prior.covariance, 6);
  }
  out.End();
}

}  // namespace

AgentId AgentOfLetter(char letter) {
  if (letter >= 'A' && letter <= 'Z') return static_cast<AgentId>(letter - 'A' + 1);
  if (letter >= 'a' && letter <= 'z') return static_cast<AgentId>(letter - 'a' + 1 + kLetters);
  return 0;
}

char LetterOfAgent(AgentId agent) {
  if (agent >= 1 && agent <= kLetters) return static_cast<char>('A' + agent - 1);
  if (agent > kLetters && agent <= 2 * kLetters) return static_cast<char>('a' + agent - 1 - kLetters);
  return '?';
}

std::optional<NodeKey> ParseKey(std::string_view text) {
  if (text.empty()) return std::nullopt;
  const AgentId agent = AgentOfLetter(text.front());
  const std::optional<std::uint64_t> index = ParseUnsigned(text.substr(1));
  if (agent == 0 || !index) return std::nullopt;
  return NodeKey{agent, *index};
}

std::string FormatKey(const NodeKey& key) { return LetterOfAgent(key.agent) + std::to_string(key.index); }

Result<Pyfg> ParsePyfg(std::string_view text, const std::string& name) {
  return PyfgParser(name).Parse(TextLines(text));
}

Result<Pyfg> ReadPyfg(const std::filesystem::path& file) {
  Result<TextLines> lines = TextLines::OfFile(file);
  if (!lines) return tl::unexpected(lines.error());
  return PyfgParser(file.string()).Parse(*std::move(lines));
}

std::string FormatPyfg(const Pyfg& pyfg) {
  Formatter out(pyfg.is_planar);
  for (const GraphNode& node : pyfg.graph.nodes) {
    out.Word("VERTEX_SE2", "VERTEX_SE3:QUAT")
        .Timestamp(node.timestamp_ns)
        .Key(node.key)
        .PoseOf(node.map_from_node)
        .End();
  }
  for (const PyfgLandmark& landmark : pyfg.landmarks) {
    out.Word("VERTEX_XY", "VERTEX_XYZ");
    if (landmark.timestamp_ns) out.Timestamp(*landmark.timestamp_ns);
    out.Key(landmark.key).Position(landmark.position_m).End();
  }
  for (const OdometryEdge& edge : pyfg.graph.odometry) FormatRelativePose(edge, pyfg.is_planar, out);
  for (const LoopClosure& edge : pyfg.graph.closures) FormatRelativePose(edge, pyfg.is_planar, out);
  for (const PyfgSighting& sighting : pyfg.sightings) {
    out.Word("EDGE_SE2_XY", "EDGE_SE3_XYZ").Timestamp(sighting.timestamp_ns).Key(sighting.from).Key(sighting.to);
    out.Position(sighting.from_point_m).UpperTriangle(sighting.covariance, pyfg.is_planar ? 2 : 3).End();
  }
  for (const RangeEdge& edge : pyfg.graph.ranges) {
    out.Word("EDGE_RANGE").Timestamp(edge.timestamp_ns).Key(edge.from).Key(edge.to);
    out.Number(edge.range_m).Number(edge.variance_m2).End();
  }
  for (const NodePrior& prior : pyfg.graph.priors) FormatPrior(prior, pyfg.is_planar, out);
  return out.Take();
}

Result<void> WritePyfg(const Pyfg& pyfg, const std::filesystem::path& file) {
  return WriteTextFile(file, FormatPyfg(pyfg));
}

}  // namespace moondb
