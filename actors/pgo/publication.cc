#include "actors/pgo/publication.h"

#include <set>
#include <tuple>

#include "actors/pgo/rover_status.h"
#include "model/far_nodes.h"

namespace moondb {

namespace {

bool HasMoved(const Pose& pose, const Pose* published, const PublicationOptions& options) {
  if (published == nullptr) return true;
  return (pose.position_m - published->position_m).norm() > options.move_threshold_m ||
         pose.orientation.angularDistance(published->orientation) > options.move_threshold_rad;
}

// Returns true if the verdict differs from the published one. A range without a published verdict counts as accepted.
// The first verdict on a loop closure or prior is always news.
bool IsNews(const FactorVerdict& verdict, const KnownGraph& known) {
  const PublishedVerdict* const published = known.FindVerdict(verdict.factor);
  if (published != nullptr) return published->is_inlier != verdict.is_inlier;
  return verdict.factor.kind != FactorKind::kRange || !verdict.is_inlier;
}

bool IsRover(const AgentFactsMap& agents, AgentId agent) {
  const auto facts = agents.find(agent);
  return facts == agents.end() || !facts->second.is_base_station;
}

template <typename Body>
void SetVersion(const proto::Term& term, std::uint64_t run, Body& body) {
  *body.mutable_term() = term;
  body.set_run(run);
}

proto::Anchoring ToProto(Anchoring anchoring) {
  switch (anchoring) {
    case Anchoring::kAnchored:
      return proto::ANCHORING_ANCHORED;
    case Anchoring::kNoRanges:
      return proto::ANCHORING_NO_RANGES;
    case Anchoring::kYawFree:
      return proto::ANCHORING_YAW_FREE;
    case Anchoring::kAmbiguous:
      return proto::ANCHORING_AMBIGUOUS;
    case Anchoring::kUnanchored:
      return proto::ANCHORING_UNANCHORED;
  }
  return proto::ANCHORING_UNSPECIFIED;
}

// Adds the refused sets. Sets that differ in the source alone become one if there are more than kSourcesMax, because a
// rover may invent any number of sources.
void AddRefused(const std::vector<FactorSet>& refused, proto::OptimizeReply& reply) {
  constexpr std::size_t kSourcesMax = 4;
  std::map<std::tuple<AgentId, FactorKind, std::pair<AgentId, AgentId>>, std::map<std::string, std::size_t>> counts;
  for (const FactorSet& set : refused) counts[{set.producer, set.kind, set.agents}][set.source] += set.factors.size();
  for (auto& [name, of_source] : counts) {
    const auto& [producer, kind, agents] = name;
    if (of_source.size() > kSourcesMax) {
      std::size_t all = 0;
      for (const auto& [source, count] : of_source) all += count;
      of_source = {{"", all}};
    }
    for (const auto& [source, count] : of_source) {
      proto::RefusedSet& out = *reply.add_refused_sets();
      out.add_agent_ids(agents.first);
      if (agents.second != agents.first) out.add_agent_ids(agents.second);
      out.set_source(source);
      out.set_is_prior(kind == FactorKind::kPrior);
      out.set_is_range(kind == FactorKind::kRange);
      out.set_count(static_cast<double>(count));
      out.set_producer(producer);
    }
  }
}

}  // namespace

Publication MakePublication(const Solution& solution, const KnownGraph& known, const AgentFactsMap& agents,
                            const PublicationOptions& options, const proto::Term& term, std::uint64_t run,
                            std::int64_t timestamp_ns) {
  Publication publication;
  if (!solution.is_accepted) return publication;
  const auto add = [&]() -> proto::Record& {
    proto::Record& record = publication.records.emplace_back();
    record.set_timestamp_ns(timestamp_ns);
    return record;
  };
  const std::set<AgentId> unplaced = FindUnplaced(solution.rovers);
  for (const auto& [node, pose] : solution.poses) {
    const bool is_unplaced = unplaced.contains(node.agent);
    const bool is_news =
        HasMoved(pose, known.FindPublished(node), options) || known.IsPublishedUnplaced(node) != is_unplaced;
    if (!IsRover(agents, node.agent) || !is_news) continue;
    proto::OptimizedPose& body = *add().mutable_optimized_pose();
    *body.mutable_node() = ToProto(node);
    *body.mutable_map_from_node() = ToProto(pose);
    body.set_ignores_raw_pose(known.quarantines().HasNode(node));
    body.set_is_unplaced(is_unplaced);
    SetVersion(term, run, body);
    ++publication.pose_count;
  }
  for (const FactorVerdict& verdict : solution.verdicts) {
    if (!IsNews(verdict, known)) continue;
    proto::EdgeVerdict& body = *add().mutable_edge_verdict();
    *body.mutable_from() = ToProto(verdict.factor.from);
    *body.mutable_to() = ToProto(verdict.factor.to);
    body.set_is_range(verdict.factor.kind == FactorKind::kRange);
    body.set_is_prior(verdict.factor.kind == FactorKind::kPrior);
    body.set_source(verdict.factor.source);
    body.set_is_inlier(verdict.is_inlier);
    body.set_residual_sigmas(verdict.residual_sigmas);
    SetVersion(term, run, body);
  }
  return publication;
}

proto::OptimizeReply ToReply(const Solution& solution) {
  proto::OptimizeReply reply;
  if (!solution.is_accepted) {
    const std::string text = "the solve was rejected, the previous poses stay valid: " + solution.text;
    *reply.mutable_error() = ToProto(Error{ErrorCode::kInternal, text, {}});
  } else if (solution.rovers.empty()) {
    *reply.mutable_error() = ToProto(Error{ErrorCode::kNotFound, solution.text, {}});
  }
  reply.set_node_count(static_cast<double>(solution.node_count));
  reply.set_odometry_count(static_cast<double>(solution.odometry_count));
  reply.set_range_count(static_cast<double>(solution.CountOf(FactorKind::kRange).usable));
  reply.set_rejected_range_count(static_cast<double>(solution.CountOf(FactorKind::kRange).rejected));
  reply.set_closure_count(static_cast<double>(solution.CountOf(FactorKind::kLoopClosure).usable));
  reply.set_rejected_closure_count(static_cast<double>(solution.CountOf(FactorKind::kLoopClosure).rejected));
  reply.set_prior_count(static_cast<double>(solution.CountOf(FactorKind::kPrior).usable));
  reply.set_rejected_prior_count(static_cast<double>(solution.CountOf(FactorKind::kPrior).rejected));
  AddRefused(solution.refused, reply);
  reply.set_initial_cost(solution.initial_cost);
  reply.set_final_cost(solution.final_cost);
  reply.set_iterations(solution.iterations);
  reply.set_initial_values(ToString(solution.initial_values));
  reply.set_text(solution.text);
  std::vector<std::pair<NodeKey, Eigen::Vector3d>> positions_m;
  for (const auto& [node, pose] : solution.poses) positions_m.emplace_back(node, pose.position_m);
  const std::vector<FarNode> far = FindFarNodes(positions_m);
  AddFarNodes(far, *reply.mutable_far_nodes());
  reply.set_far_node_count(static_cast<double>(far.size()));
  for (const auto& [node, covariance] : solution.covariances) {
    proto::NodeCovariance& out = *reply.add_covariances();
    *out.mutable_node() = ToProto(node);
    AddUpperTriangle(covariance, *out.mutable_covariance());
  }
  const std::set<AgentId> unplaced = FindUnplaced(solution.rovers);
  for (const RoverResult& rover : solution.rovers) {
    proto::RoverSolution& out = *reply.add_rovers();
    out.set_agent_id(rover.agent);
    out.set_anchoring(ToProto(rover.anchoring));
    out.set_odometry_scale(rover.odometry_scale);
    out.set_node_count(static_cast<double>(rover.node_count));
    out.set_text(rover.text);
    out.set_is_unplaced(unplaced.contains(rover.agent));
  }
  return reply;
}

}  // namespace moondb
