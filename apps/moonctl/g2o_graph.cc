#include "apps/moonctl/g2o_graph.h"

#include <Eigen/LU>
#include <map>
#include <optional>

#include "model/g2o_id.h"

namespace moondb {
namespace {

// Returns the node of an id. Plain ids belong to `plain_agent`; 0 refuses them.
Result<NodeKey> KeyOf(std::uint64_t id, AgentId plain_agent) {
  const std::optional<NodeKey> node = NodeOfId(id);
  if (!node) {
    return Fail(ErrorCode::kInvalid,
                "vertex " + std::to_string(id) +
                    " names no node: an id is a GTSAM Symbol, a LabeledSymbol with the robot's letter as label, or an "
                    "index below 2^32");
  }
  if (node->agent != 0) return *node;
  if (plain_agent != 0) return NodeKey{plain_agent, id};
  return Fail(ErrorCode::kInvalid, "vertex " + std::to_string(id) + " names no robot: name one with -a");
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
    if (node.key.index > kSymbolIndexMax) {
      return Fail(ErrorCode::kInvalid, "the index of node " + FormatKey(node.key) +
                                           " is beyond the symbols of g2o (2^48): export the graph as pyfg");
    }
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
  if (g2o.vertices.empty()) {
    return Fail(ErrorCode::kInvalid,
                "the graph has no vertex line: write one for each node, since the first vertex of a "
                "robot is where it starts");
  }
  Pyfg pyfg;
  pyfg.is_planar = g2o.is_planar;
  std::map<NodeKey, std::uint64_t> id_of;
  for (const G2oVertex& vertex : g2o.vertices) {
    const std::string place = PlaceText(g2o, vertex.place);
    const Result<NodeKey> key = KeyOf(vertex.id, plain_agent);
    if (!key) return Fail(key.error().code, key.error().text, place);
    const auto [known, is_new] = id_of.emplace(*key, vertex.id);
    if (!is_new) {
      return Fail(ErrorCode::kInvalid,
                  "the vertices " + std::to_string(known->second) + " and " + std::to_string(vertex.id) +
                      " are both node " + FormatKey(*key),
                  place);
    }
    pyfg.graph.nodes.push_back({*key, 0, vertex.map_from_vertex});
  }
  // The reader of the file has checked that the nodes of edges and priors are vertices.
  for (const G2oEdge& edge : g2o.edges) {
    const Result<Matrix6d> covariance = InverseOf(edge.information);
    if (!covariance) return Fail(covariance.error().code, covariance.error().text, PlaceText(g2o, edge.place));
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
