// KnownGraph: the pose graph in this agent's storage, with all poses, verdicts and map matches that leaders have
// published. A new or restarted leader continues from these poses and verdicts.
//
// Nodes and edges have separate limits. Beyond a limit, or its equal part of it, an agent keeps only its newest records
// (model/origin_quota.h), so the graph depends only on the set of records. Published poses, verdicts and map matches
// have limits too. Beyond these limits, later arrivals are dropped, which is acceptable because only leaders publish.
// Single-threaded.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "actors/pgo/graph_quarantines.h"
#include "actors/pgo/pose_graph_solver.h"
#include "actors/pgo/solve_size.h"
#include "model/error.h"
#include "model/origin_quota.h"
#include "model/pose_graph.h"
#include "model/record_key.h"
#include "model/term.h"

namespace moondb {

struct PublishedVerdict {
  bool is_inlier = true;
  double residual_sigmas = 0;  // FactorVerdict::residual_sigmas at the time of publication.
};

class KnownGraph {
 public:
  // A solve takes about 9 kB for each node with its odometry and ranges (measured with 9,769 nodes and 7,789 ranges),
  // and an estimated 2.5 kB for each further edge. One of four agents can therefore make a solve take about 200 MB, and
  // all agents 700 MB, which the memory limits of packaging/ allow.
  struct Limits {
    std::size_t nodes_max = 60'000;  // Maximum number of nodes, and also of published poses.
    // Maximum number of edges and priors, also of published verdicts, and also of map matches.
    std::size_t edges_max = 180'000;
    // Number of agents of the team. No agent has more than its equal part of nodes and of edges.
    std::size_t agent_count = 1;
  };
  // Nodes of one agent without any edge or prior that a solve uses. Such a node keeps its raw pose.
  static constexpr std::size_t kUntiedNodesMax = 1000;

  // The part of the graph that a solve uses.
  struct Selection {
    PoseGraph graph;
    std::map<AgentId, std::uint64_t> left_out;  // Number of nodes and edges left out, by the origin of their records.
  };

  KnownGraph() : KnownGraph(Limits()) {}
  explicit KnownGraph(const Limits& limits);

  // Adds a node, edge, prior, map match, optimized pose, verdict or quarantine; ignores other types. Call it once per
  // record, in any order. Returns kInvalid for an invalid pose or covariance, without changing anything.
  //
  // Conflicts are resolved independently of the order of arrival, so all agents hold the same graph. Among poses of one
  // node, or verdicts on one factor, the record with the highest (term, run, record key) is kept. Among nodes, edges or
  // priors with the same natural key (NaturalKey in model/record_check.h), the record with the smallest record key is
  // kept.
  Result<void> Add(const RecordKey& key, const proto::Record& record);

  // Returns the whole graph as it was added, without quarantined factors.
  PoseGraph graph() const { return Select({UINT64_MAX, UINT64_MAX}, /*has_all_nodes=*/true).graph; }
  // Returns a graph without quarantined factors, whose solve stays within `size`. Ranges have a sigma of at least 5 cm,
  // loop closures of at least 2 cm and 2 mrad. Variances that would be left out are limited (LimitVariances). A
  // quarantined node gets the pose of its neighbour composed with odometry instead of its raw pose. Without such
  // odometry it is left out. The graph contains all nodes except the untied ones beyond kUntiedNodesMax, all priors,
  // the odometry from each node to the next, and the newest other edges of each origin, up to a limit per origin. The
  // limit starts at the largest number of such edges of any origin, and is halved until the solve fits or the limit is
  // zero.
  Selection SelectForSolve(const SolveSize& size) const;
  // Returns the maximum size of a solve with this many nodes. Public benchmark graphs need several times less.
  static SolveSize SolveSizeMax(std::size_t node_count);
  std::size_t node_count() const { return nodes_.size(); }
  // Returns the first node of each agent whose earlier nodes were dropped, with its published pose. A solve continues
  // from this pose. Agents whose first node has no published pose, or an unplaced one, are absent.
  std::map<NodeKey, Pose> FindContinuations() const;
  // Returns the number of records dropped because a limit was reached, by origin. Origins without dropped records are
  // absent.
  std::map<AgentId, std::uint64_t> CountLeftOut() const;

  // Returns the newest published pose of each node, and the newest verdicts.
  LastSolution FindLastSolution() const;
  // Returns the node's published pose. Null if none is published, or if the node is quarantined and the pose used its
  // raw pose.
  const Pose* FindPublished(const NodeKey& node) const;
  // Returns whether the node's published pose is one of an unplaced rover (OptimizedPose.is_unplaced).
  bool IsPublishedUnplaced(const NodeKey& node) const;
  const GraphQuarantines& quarantines() const { return quarantines_; }
  std::size_t published_count() const { return poses_.size(); }  // Number of nodes with a published pose.
  // Returns the newest pose of each of these nodes of graph(): its valid pose (model/pose_carrier.h), or the raw pose
  // if odometry does not connect the node with the last published pose. Requires: `nodes` are all nodes of graph().
  std::map<NodeKey, Pose> FindNewestPoses(const std::vector<GraphNode>& nodes) const;

  // Returns the last published verdict on a factor. Null if none is published; such a range counts as accepted, and
  // such a loop closure or prior was not part of a solve yet.
  const PublishedVerdict* FindVerdict(const FactorKey& factor) const;

  std::vector<NodeKey> NewestNodes() const;  // Returns the newest node of each agent.

  // Returns the number of the last known solve (run) in `term`; 0 if none is known, or if a solve of a later term is
  // known.
  std::uint64_t LastRun(const proto::Term& term) const;

 private:
  using Run = std::pair<decltype(OrderOf(proto::Term())), std::uint64_t>;
  using Version = std::pair<Run, RecordKey>;

  using EdgeName = std::pair<NodeKey, NodeKey>;  // The edge's ends (from, to).
  // Keyed by (node key or edge ends, record key). Only the first record of each node or edge is valid.
  template <typename Name, typename Item>
  using Records = std::map<std::pair<Name, RecordKey>, Item>;
  struct EdgeNote {
    FactorKey key;  // The kind of odometry is meaningless.
    bool is_odometry = false;
  };

  struct Match {
    LoopClosure closure;
    std::int64_t from_timestamp_ns = 0;  // Timestamps of the maps.
    std::int64_t to_timestamp_ns = 0;
  };

  template <typename T>
  struct Versioned {
    Version version;
    T value;
  };

  Result<void> AddPose(const RecordKey& key, const proto::OptimizedPose& pose);
  void AddVerdict(const RecordKey& key, const proto::EdgeVerdict& verdict);
  Result<void> AddMatch(const RecordKey& key, const proto::Record& record);
  void AddEdge(const RecordKey& key, const EdgeNote& note);
  bool IsQuarantined(const RecordKey& key, const Match& match) const;
  Selection Select(const SolveSize& size, bool has_all_nodes) const;
  std::vector<GraphNode> SelectNodes(std::map<AgentId, std::uint64_t>* left_out) const;
  std::set<NodeKey> FindTiedNodes() const;
  void LeaveOutUntied(std::vector<std::pair<RecordKey, GraphNode>>& nodes,
                      std::map<AgentId, std::uint64_t>& left_out) const;
  std::optional<Pose> ComposePose(const std::vector<GraphNode>& before, const GraphNode& node,
                                  const GraphNode* next) const;
  const OdometryEdge* FindOdometry(const NodeKey& from, const NodeKey& to) const;

  Limits limits_;
  Records<NodeKey, GraphNode> nodes_;
  OriginQuota<NodeKey> node_quota_;
  Records<EdgeName, OdometryEdge> odometry_;
  Records<EdgeName, RangeEdge> ranges_;
  Records<FactorKey, LoopClosure> closures_;
  Records<FactorKey, NodePrior> priors_;
  OriginQuota<EdgeNote> edge_quota_;  // Quota of odometry, ranges, loop closures and priors together.
  struct PublishedPose {
    Pose map_from_node;
    bool ignores_raw_pose = false;
    bool is_unplaced = false;
  };
  std::map<NodeKey, Versioned<PublishedPose>> poses_;
  std::map<FactorKey, Versioned<PublishedVerdict>> verdicts_;
  std::map<EdgeName, Versioned<Match>> matches_;
  std::map<AgentId, std::uint64_t> left_out_published_;
  GraphQuarantines quarantines_;
  Run newest_run_;
};

}  // namespace moondb
