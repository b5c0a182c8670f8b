// PlaceCheck: finds out whether two rovers' maps contradict each other where the solve places the rovers.
//
// A start in the team file that is wrong places a rover firmly, and no match of maps corrects it. Therefore rovers that
// only their start places are checked, if hardly any pair of their maps and those of another rover matched. All submaps
// (submap.h) of both are compared at the solved poses, within the uncertainty of the odometry. The maps contradict each
// other if a large part of their common hazards lies in free space of the other. The part must be much larger than
// within each rover's own maps: on open ground, hazards seen from afar contradict those seen nearby.
//
// Deterministic. Single-threaded. A step takes up to 0.1 s. Memory: 64 submaps of 0.3 MB during a check.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <set>
#include <vector>

#include "actors/registration/known_maps.h"
#include "actors/registration/match_plan.h"
#include "actors/registration/searched_rover.h"
#include "actors/registration/start_verdict.h"
#include "actors/registration/submap_graph.h"

namespace moondb {

// How the maps of two rovers fit at the solved poses.
struct PlaceFit {
  double matched = 0;           // Part of the common hazards that both have.
  double contradicted = 0;      // Part that lies in the other's free space.
  double own_contradicted = 0;  // Within the maps of one rover; the larger of the two.
  bool is_contradicted = false;
};

class PlaceCheck {
 public:
  using AgentPair = MatchPlan::AgentPair;

  // Returns whether so few pairs of the maps of two rovers match that their places are doubtful.
  static bool IsDoubtful(const MatchPlan::Counts& counts);

  // Begins a pass over pairs of rovers. `placed`: all agents whose poses are in the frame `map`.
  void Begin(std::vector<AgentPair> pairs, std::set<AgentId> placed);
  // Fuses one submap, or compares one pair of submaps. Requires: left_count() is not 0.
  void Step(const KnownMaps& maps);
  // Number of pairs of rovers that are still to be compared.
  std::size_t left_count() const { return pairs_.size(); }
  // Results of this pass.
  const std::map<AgentPair, PlaceFit>& fits() const { return fits_; }
  void Clear() { *this = PlaceCheck(); }

 private:
  // The comparison of one pair of rovers. Its graph holds the frame `map`, the submaps of the first rover, and those of
  // the second.
  struct Comparison {
    std::size_t second_pose() const { return 1 + rovers[0].windows().size(); }
    std::shared_ptr<const Submap> Fuse(std::size_t pose, const KnownMaps& maps) const;

    SearchedRover rovers[2];
    SubmapGraph graph;
    std::vector<std::shared_ptr<const Submap>> submaps;
    std::vector<std::pair<std::size_t, std::size_t>> left;  // Pairs of submaps.
    SetFit fit;
    SetFit own[2];
  };
  static std::optional<Comparison> Compare(const AgentPair& agents, const std::set<AgentId>& placed,
                                           const KnownMaps& maps);
  void Finish();

  std::vector<AgentPair> pairs_;  // The present one last.
  std::set<AgentId> placed_;
  std::optional<Comparison> comparison_;
  std::map<AgentPair, PlaceFit> fits_;
};

}  // namespace moondb
