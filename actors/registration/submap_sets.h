// SubmapSets: finds sets of places (submap_matching.h) of two rovers' submaps that agree with both rovers' odometry.
//
// Two places agree if the loop through both odometries closes (chi-square of three degrees of freedom, 99 %). From each
// place a clique of agreeing places grows greedily, the most evident places first. The poses of the submaps are then
// solved from odometry and the clique; places that fit the solved poses are taken, others are dropped, three times.
// The evidence of a set is the sum over the submaps of a rover of the evidence of their best place; of the weaker
// rover.
//
// Deterministic. Not thread-safe.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "actors/registration/planar_offset.h"
#include "actors/registration/rover_track.h"
#include "actors/registration/submap.h"
#include "actors/registration/submap_graph.h"
#include "actors/registration/submap_matching.h"

namespace moondb {

// A place of window `second` of the second rover in window `first` of the first rover.
struct SubmapHypothesis {
  std::size_t first = 0;
  std::size_t second = 0;
  SubmapPlace place;
};

// Indices of the nodes of a submap's first and last map, and of the node that gives its frame.
struct SubmapNodes {
  std::uint64_t first = 0;
  std::uint64_t middle = 0;
  std::uint64_t last = 0;
};

// A rover's track and the windows of its submaps.
struct TrackSubmaps {
  std::shared_ptr<const RoverTrack> track;
  std::vector<SubmapWindow> windows;

  SubmapNodes NodesOf(std::size_t window) const;
  PlanarOffset OdomFromSubmap(std::size_t window) const { return track->odom_from_node(windows[window].middle); }
};

// Adds the odometry between successive windows of a rover. `first_pose`: the pose of its first window.
void AddOdometry(const TrackSubmaps& rover, std::size_t first_pose, SubmapGraph& graph);

// A set, with the poses of all submaps of both rovers in the odometry frame of the first rover.
struct SubmapSet {
  std::vector<std::size_t> members;  // Indices of hypotheses, ascending.
  double evidence = 0;
  SubmapGraph graph;            // Solved: the submaps of the first rover, then those of the second.
  double sigma_m = 0;           // Largest standard deviation of a position between the submaps of a member.
  std::size_t first_count = 0;  // Number of submaps of the first rover.

  const PlanarOffset& FirstPose(std::size_t window) const { return graph.poses()[window]; }
  const PlanarOffset& SecondPose(std::size_t window) const { return graph.poses()[first_count + window]; }
};

class SubmapSets {
 public:
  static constexpr std::size_t kHypothesesMax = 600;  // The most evident ones are used.
  static constexpr std::size_t kSetsMax = 4;
  static constexpr std::size_t kSolvedMax = 8;  // Cliques that are solved for each set.

  SubmapSets(TrackSubmaps first, TrackSubmaps second, std::vector<SubmapHypothesis> hypotheses);

  // Finds the next of up to kSetsMax disjoint sets. Returns false if there is none.
  bool FindNext();

  const std::vector<SubmapSet>& sets() const { return sets_; }
  const std::vector<SubmapHypothesis>& hypotheses() const { return hypotheses_; }  // The most evident first.
  const TrackSubmaps& first() const { return first_; }
  const TrackSubmaps& second() const { return second_; }

 private:
  bool Agree(const SubmapHypothesis& a, const SubmapHypothesis& b) const;
  std::vector<std::size_t> CliqueOf(std::size_t seed) const;
  double EvidenceOf(const std::vector<std::size_t>& members) const;
  SubmapSet Solve(std::vector<std::size_t> members) const;

  TrackSubmaps first_;
  TrackSubmaps second_;
  std::vector<SubmapHypothesis> hypotheses_;
  std::vector<std::vector<bool>> agree_;
  std::vector<bool> is_used_;
  std::vector<SubmapSet> sets_;
};

}  // namespace moondb
