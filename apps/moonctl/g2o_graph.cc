#include "apps/moonctl/g2o_graph.h"

#include <Eigen/LU>
#include <optional>

namespace moondb {
namespace {

constexpr int kIndexBits = 56;
constexpr std::uint64_t kIndexMax = (std::uint64_t{1} << kIndexBits) - 1;

std::uint64_t SymbolOf(const NodeKey& key) {
  return std::uint64_t{static_cast<unsigned char>(LetterOfAgent(key.agent))} << kIndexBits | key.index;
}

std::optional<NodeKey> KeyOf(std::uint64_t id, AgentId plain_agent) {
  const AgentId agent = AgentOfLetter(static_cast<char>(id >> kIndexBits));
  if (agent != 0) return NodeKey{agent, id & kIndexMax};
  if (plain_agent == 0) return std::nullopt;
  return NodeKey{plain_agent, id};
}

Result<Matrix6d> InverseOf(const Matrix6d& matrix) {
  const Matrix6d inverse = matrix.inverse();
  if (inverse.allFinite()) return inverse;
  return Fail(ErrorCode::kInvalid, "the covariance or information matrix of an edge cannot be inverted");
}

// Rotates the covariance of a pose prior from the frame `map` into the frame of the measured pose, or back. g2o uses
// the latter. Returns the covariance of a position prior unchanged.
Matrix6d InFrameOfPose(const NodePrior& prior, bool is_into) {
  if (prior.extent != PriorExtent::kPose) return prior.covariance;
  const Eigen::Matrix3d map_from_node = prior.map_from_node.orientation.toRotationMatrix();
  Matrix6d rotation = Matrix6d::Zero();
  rotation.topLeftCorner<3, 3>() = rotation.bottomRightCorner<3, 3>() =
      is_into ? Eigen::Matrix3d(map_from_node.transpose()) : map_from_node;
  return rotation * prior.covariance * rotation.transpose();
}

}  // namespace

Result<G2o> ToG2o(const Pyfg& pyfg) {
  G2o g2o;
  g2o.is_planar = pyfg.is_planar;
  for (const GraphNode& node : pyfg.graph.nodes) {
    if (node.key.index > kIndexMax)
      return Fail(ErrorCode::kInvalid, "a node's number exceeds the largest number of a g2o symbol (2^56)");
    g2o.vertices.push_back({SymbolOf(node.key), node.map_from_node});
  }
  const auto add = [&g2o](const auto& edges) -> Result<void> {
    for (const auto& edge : edges) {
      const Result<Matrix6d> information = InverseOf(edge.covariance);
      if (!information) return tl::unexpected(information.error());
      g2o.edges.push_back({SymbolOf(edge.from), SymbolOf(edge.to), edge.from_from_to, *information});
    }
    return {};
  };
  if (auto added = add(pyfg.graph.odometry); !added) return tl::unexpected(added.error());
  if (auto added = add(pyfg.graph.closures); !added) return tl::unexpected(added.error());
  for (const NodePrior& measured : pyfg.graph.priors) {
    const NodePrior prior = WithTilt(measured);
    const Result<Matrix6d> information = InverseOf(InFrameOfPose(prior, /*is_into=*/true));
    if (!information) return tl::unexpected(information.error());
    g2o.priors.push_back({SymbolOf(prior.node), prior.extent, prior.map_from_node, *information});
  }
  return g2o;
}

Result<Pyfg> ToPyfg(const G2o& g2o, AgentId plain_agent) {
  if (g2o.vertices.empty()) return Fail(ErrorCode::kInvalid, "the file has no vertex, so the first pose is unknown");
  Pyfg pyfg;
  pyfg.is_planar = g2o.is_planar;
  for (const G2oVertex& vertex : g2o.vertices) {
    const std::optional<NodeKey> key = KeyOf(vertex.id, plain_agent);
    if (!key) {
      return Fail(ErrorCode::kInvalid,
                  "vertex " + std::to_string(vertex.id) + " has an id that names no robot; name the robot with -a");
    }
    pyfg.graph.nodes.push_back({*key, 0, vertex.map_from_vertex});
  }
  for (const G2oEdge& edge : g2o.edges) {
    const Result<Matrix6d> covariance = InverseOf(edge.information);
    if (!covariance) return tl::unexpected(covariance.error());
    // The reader of the file has checked that both nodes of an edge are vertices.
    pyfg.graph.odometry.push_back(
        {*KeyOf(edge.from, plain_agent), *KeyOf(edge.to, plain_agent), 0, edge.from_from_to, *covariance});
  }
  for (const G2oPrior& prior : g2o.priors) {
    const Result<Matrix6d> covariance = InverseOf(prior.information);
    if (!covariance) return tl::unexpected(covariance.error());
    NodePrior converted;
    converted.node = *KeyOf(prior.id, plain_agent);
    converted.extent = prior.extent;
    converted.map_from_node = prior.map_from_vertex;
    converted.covariance = *covariance;
    converted.covariance = InFrameOfPose(converted, /*is_into=*/false);
    pyfg.graph.priors.push_back(converted);
  }
  return pyfg;
}

}  // namespace moondb
