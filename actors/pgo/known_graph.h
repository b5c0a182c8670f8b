// KnownGraph: the pose graph as this agent's storage holds it, and what leaders have said of it so far.
//
// Filled from records, in any order, each once. What a leader published is read back like any other record, so a new
// leader goes on where the last one stopped, and so does one that restarted, but for moves too small to be published
// (publication.h). Single-threaded.
//
// Nodes and edges have a limit each. Beyond it the agents with most of them keep their newest ones
// (model/origin_quota.h), so that the graph depends on the set of records alone. Published poses and verdicts beyond
// their limit are left out in the order in which they come; leaders alone state these.
#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

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
  double residual_sigmas = 0;  // As in RangeVerdict, when it was last published.
};

class KnownGraph {
 public:
  struct Limits {
    std::size_t nodes_max = 200'000;  // And as many published poses.
    std::size_t edges_max = 600'000;  // And as many published verdicts.
  };

  // The part of the graph that a solve may use.
  struct Selection {
    PoseGraph graph;
    std::map<AgentId, std::uint64_t> left_out;  // Edges, by origin.
  };

  KnownGraph() : KnownGraph(Limits()) {}
  explicit KnownGraph(const Limits& limits);

  // Takes nodes, edges, optimized poses and edge verdicts, and ignores other types. Of two poses of a node, or two
  // verdicts of an edge, the newer (term, run) stays, of equal ones the greater key; of two records of one natural key
  // (a node's own, an edge's kind and ends) the smaller record key, so that all agents hold the same graph whatever
  // came first. kInvalid: a pose or covariance that is none; nothing changed.
  Result<void> Add(const RecordKey& key, const proto::Record& record);

  // All nodes and edges.
  PoseGraph graph() const { return SelectForSolve({UINT64_MAX, UINT64_MAX}).graph; }
  // The largest graph whose solve stays within `size`: all nodes, each one's odometry from the node before, and of the
  // other edges of each origin as many as the level says, the newest ones. The level is the highest that fits, among
  // all edges of the origin that has most of them, half as many, a quarter and so on down to none.
  Selection SelectForSolve(const SolveSize& size) const;
  // As large as a solve of so many nodes should ever be: several times what public pose graphs need.
  static SolveSize SolveSizeMax(std::size_t node_count);
  std::size_t node_count() const { return nodes_.size(); }
  // The number of records for which there was no room, of each origin that has such.
  std::map<AgentId, std::uint64_t> CountLeftOut() const;

  // The newest published pose of each node, and the ranges whose newest verdict is bad.
  LastSolution FindLastSolution() const;
  const Pose* FindPublished(const NodeKey& node) const;          // Null where there is none.
  std::size_t published_count() const { return poses_.size(); }  // Nodes that have one.
  // Where there is none, the raw pose.
  const Pose& NewestPose(const GraphNode& node) const;

  // What was last published of a range; null where nobody spoke of it, which counts as good.
  const PublishedVerdict* FindVerdict(const RangeKey& range) const;
  bool IsPublishedInlier(const RangeKey& range) const;

  std::vector<NodeKey> NewestNodes() const;  // One of each agent that has nodes.

  // The largest run of `term` seen; 0: none.
  std::uint64_t LastRun(const proto::Term& term) const;

 private:
  using Run = std::pair<decltype(OrderOf(proto::Term())), std::uint64_t>;
  using Version = std::pair<Run, RecordKey>;

  using EdgeName = std::pair<NodeKey, NodeKey>;  // from, to
  // By natural key, then by record: the first record of a natural key stands.
  template <typename Name, typename Item>
  using Records = std::map<std::pair<Name, RecordKey>, Item>;
  struct EdgeNote {
    EdgeName name;
    bool is_range = false;
  };

  template <typename T>
  struct Versioned {
    Version version;
    T value;
  };

  Result<void> AddPose(const RecordKey& key, const proto::OptimizedPose& pose);
  void AddVerdict(const RecordKey& key, const proto::EdgeVerdict& verdict);
  void AddEdge(const RecordKey& key, const EdgeNote& note);

  Limits limits_;
  Records<NodeKey, GraphNode> nodes_;
  OriginQuota<NodeKey> node_quota_;
  Records<EdgeName, OdometryEdge> odometry_;
  Records<EdgeName, RangeEdge> ranges_;
  OriginQuota<EdgeNote> edge_quota_;  // Odometry and ranges share it.
  std::map<NodeKey, Versioned<Pose>> poses_;
  std::map<RangeKey, Versioned<PublishedVerdict>> verdicts_;
  std::map<AgentId, std::uint64_t> left_out_published_;
  Run newest_run_;
};

}  // namespace moondb
