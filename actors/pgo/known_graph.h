// KnownGraph: the pose graph as this agent's storage holds it, and what leaders have said of it so far.
//
// Filled from records, in any order; grows with the mission as the storage does. What a leader published is read back
// like any other record, so a new leader goes on where the last one stopped, and so does one that restarted, but for
// moves too small to be published (publication.h). Single-threaded.
#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "actors/pgo/pose_graph_solver.h"
#include "model/error.h"
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
  // Takes nodes, edges, optimized poses and edge verdicts, and ignores other types. Of two poses of a node, or two
  // verdicts of an edge, the newer (term, run) stays, of equal ones the greater key; of two records of one natural key
  // (a node's own, an edge's kind and ends) the smaller record key, so that all agents hold the same graph whatever
  // came first. kInvalid: a pose or covariance that is none; nothing changed.
  Result<void> Add(const RecordKey& key, const proto::Record& record);

  const PoseGraph& graph() const { return graph_; }

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

  // Which record a place of a vector in graph_ came from.
  struct Source {
    RecordKey key;
    std::size_t place = 0;
  };
  using EdgeName = std::pair<NodeKey, NodeKey>;  // from, to

  template <typename T>
  struct Versioned {
    Version version;
    T value;
  };

  Result<void> AddPose(const RecordKey& key, const proto::OptimizedPose& pose);
  void AddVerdict(const RecordKey& key, const proto::EdgeVerdict& verdict);
  template <typename Name, typename Item>
  static void AddItem(const RecordKey& key, const Name& name, const Item& item, std::map<Name, Source>& sources,
                      std::vector<Item>& items);

  PoseGraph graph_;
  std::map<NodeKey, Versioned<Pose>> poses_;
  std::map<RangeKey, Versioned<PublishedVerdict>> verdicts_;
  Run newest_run_;
  std::map<NodeKey, Source> node_sources_;
  std::map<EdgeName, Source> odometry_sources_;
  std::map<EdgeName, Source> range_sources_;
};

}  // namespace moondb
