#include "actors/pgo/placement_by_poses.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace moondb {

namespace {

constexpr std::size_t kProposalsMax = 100;  // Proposals of one rover that are compared, evenly spread.
constexpr double kAgreementSigmas = 3;
constexpr double kSameYaw_rad = 0.1;
constexpr double kScaleSigma = 0.02;  // As SolverOptions::scale_sigma.

// A place of a rover's body, proposed by one measurement.
struct Proposal {
  Pose motion;           // Moves the rover's initial poses to the proposed place: a rotation about z and a translation.
  std::size_t node = 0;  // The rover's measured node.
  std::size_t other = 0;  // The other end of a loop closure. For a prior, the same as `node`.
  bool has_yaw = true;    // False if only the position at `node` is measured.
  double variance_m2 = 0;
  double variance_rad2 = 0;

  bool IsPrior() const { return node == other; }
};

// Sums of the odometry's uncertainty along a rover's nodes.
struct Drift {
  double length_m = 0;
  double variance_m2 = 0;
  double variance_rad2 = 0;
};

// Returns the motion that moves `from` to the position and yaw of `to`.
Pose UprightMotion(const Pose& from, const Pose& to) {
  Pose motion = Pose::FromPlanar(0, 0, to.Yaw() - from.Yaw());
  motion.position_m = to.position_m - motion * from.position_m;
  return motion;
}

class Placer {
 public:
  Placer(const CheckedGraph& graph, const std::vector<Rover>& rovers, const std::vector<StartPrior>& starts,
         const std::vector<std::size_t>& unknown, const InitialValues& initial)
      : graph_(graph), rovers_(rovers), unknown_(unknown), drift_(graph.nodes.size()) {
    result_.initial = initial;
    for (std::size_t i = 0; i < rovers.size(); ++i) {
      rover_of_[rovers[i].agent] = i;
      is_placed_.push_back(starts[i].is_configured);
      SumDrift(rovers[i]);
    }
    closures_of_.resize(rovers.size());
    priors_of_.resize(rovers.size());
    for (const CheckedClosure& closure : graph.closures) {
      const AgentId from = closure.edge->from.agent;
      const AgentId to = closure.edge->to.agent;
      if (from == to) continue;
      closures_of_[rover_of_.at(from)].push_back(&closure);
      closures_of_[rover_of_.at(to)].push_back(&closure);
    }
    for (const CheckedPrior& prior : graph.priors) {
      priors_of_[rover_of_.at(prior.prior->node.agent)].push_back(&prior);
    }
  }

  PosePlacement Run() {
    bool may_stand = std::none_of(is_placed_.begin(), is_placed_.end(), [](bool is_placed) { return is_placed; });
    while (true) {
      if (PlaceBest()) continue;
      if (!may_stand || result_.placed.size() > 0 || !StandOne()) break;
      may_stand = false;
    }
    for (const std::size_t i : unknown_) {
      if (!is_placed_[i]) result_.not_placed[rovers_[i].agent] = WhyNot(i);
    }
    return std::move(result_);
  }

 private:
  void SumDrift(const Rover& rover) {
    std::map<std::size_t, const CheckedOdometry*> steps;
    for (const CheckedOdometry& step : graph_.odometry) {
      if (step.to >= rover.first && step.to < rover.first + rover.count) steps[std::max(step.from, step.to)] = &step;
    }
    for (std::size_t node = rover.first + 1; node < rover.first + rover.count; ++node) {
      drift_[node] = drift_[node - 1];
      const auto step = steps.find(node);
      if (step == steps.end()) continue;
      const Matrix6d& covariance = step->second->edge->covariance;
      drift_[node].length_m += step->second->from_from_to.position_m.norm();
      drift_[node].variance_m2 += covariance.diagonal().head<3>().maxCoeff();
      drift_[node].variance_rad2 += covariance(5, 5);
    }
  }

  const Pose& PoseAt(std::size_t node) const { return result_.initial.poses[node]; }

  // Returns true if the node belongs to a placed rover.
  bool IsPlaced(std::size_t node) const {
    const auto rover = rover_of_.find(graph_.nodes[node].key.agent);
    return rover != rover_of_.end() && is_placed_[rover->second];
  }

  bool IsOf(std::size_t node, std::size_t rover) const { return graph_.nodes[node].key.agent == rovers_[rover].agent; }

  std::vector<Proposal> FindProposals(std::size_t rover) const {
    std::vector<Proposal> proposals;
    for (const CheckedClosure* const joined : closures_of_[rover]) {
      const CheckedClosure& closure = *joined;
      const bool is_to = IsOf(closure.to, rover);
      if (!IsPlaced(is_to ? closure.from : closure.to)) continue;
      Proposal proposal;
      proposal.node = is_to ? closure.to : closure.from;
      proposal.other = is_to ? closure.from : closure.to;
      const Pose measured = PoseAt(proposal.other) * (is_to ? closure.from_from_to : closure.from_from_to.Inverse());
      proposal.motion = UprightMotion(PoseAt(proposal.node), measured);
      proposal.variance_m2 = closure.edge->covariance.diagonal().head<3>().maxCoeff();
      proposal.variance_rad2 = closure.edge->covariance(5, 5);
      proposals.push_back(proposal);
    }
    AddPriors(rover, proposals);
    return Thinned(std::move(proposals));
  }

  void AddPriors(std::size_t rover, std::vector<Proposal>& proposals) const {
    std::vector<const CheckedPrior*> positions;
    for (const CheckedPrior* const checked : priors_of_[rover]) {
      const NodePrior& prior = *checked->prior;
      if (prior.extent == PriorExtent::kPosition) {
        positions.push_back(checked);
        continue;
      }
      Proposal proposal = ProposalOf(*checked);
      Pose measured = PoseAt(checked->node);
      measured = UprightMotion(measured, prior.map_from_node) * measured;
      measured.position_m = prior.map_from_node.position_m - (measured.orientation * prior.point_m);
      proposal.motion = UprightMotion(PoseAt(checked->node), measured);
      proposal.variance_rad2 =
          prior.covariance(prior.extent == PriorExtent::kPose ? 5 : 3, prior.extent == PriorExtent::kPose ? 5 : 3);
      proposals.push_back(proposal);
    }
    positions = Thinned(std::move(positions));
    for (const CheckedPrior* const prior : positions) AddPositions(*prior, positions, proposals);
  }

  Proposal ProposalOf(const CheckedPrior& checked) const {
    Proposal proposal;
    proposal.node = proposal.other = checked.node;
    proposal.variance_m2 = checked.prior->covariance.diagonal().head<3>().maxCoeff();
    return proposal;
  }

  // Adds the place at which the positions of `prior` and of the farthest other position prior fit.
  void AddPositions(const CheckedPrior& prior, const std::vector<const CheckedPrior*>& positions,
                    std::vector<Proposal>& proposals) const {
    const auto point_of = [this](const CheckedPrior& checked) {
      return Eigen::Vector3d(PoseAt(checked.node) * checked.prior->point_m);
    };
    const Eigen::Vector3d here = point_of(prior);
    const CheckedPrior* farthest = nullptr;
    double farthest_m = kApart_m;
    for (const CheckedPrior* const other : positions) {
      const double distance_m = (point_of(*other) - here).head<2>().norm();
      if (distance_m <= farthest_m) continue;
      farthest = other;
      farthest_m = distance_m;
    }
    if (farthest == nullptr) return;
    const Eigen::Vector3d before = point_of(*farthest) - here;
    const Eigen::Vector3d after = farthest->prior->map_from_node.position_m - prior.prior->map_from_node.position_m;
    Proposal proposal = ProposalOf(prior);
    proposal.motion = Pose::FromPlanar(0, 0, std::atan2(after.y(), after.x()) - std::atan2(before.y(), before.x()));
    proposal.motion.position_m = prior.prior->map_from_node.position_m - proposal.motion * here;
    proposal.has_yaw = false;
    proposal.variance_rad2 = 2 * proposal.variance_m2 / (farthest_m * farthest_m);
    proposals.push_back(proposal);
  }

  template <typename T>
  static std::vector<T> Thinned(std::vector<T> all) {
    if (all.size() <= kProposalsMax) return all;
    std::vector<T> kept;
    for (std::size_t i = 0; i < kProposalsMax; ++i) kept.push_back(all[i * all.size() / kProposalsMax]);
    return kept;
  }

  // Adds the variances by which odometry lets the poses of two nodes of one rover differ. Adds nothing for nodes of two
  // rovers.
  void AddDrift(std::size_t a, std::size_t b, double& variance_m2, double& variance_rad2) const {
    if (graph_.nodes[a].key.agent != graph_.nodes[b].key.agent) return;
    const Drift& from = drift_[std::min(a, b)];
    const Drift& to = drift_[std::max(a, b)];
    const double turn_rad2 = to.variance_rad2 - from.variance_rad2;
    const double scale_m = kScaleSigma * (to.length_m - from.length_m);
    const double distance_m2 = (PoseAt(a).position_m - PoseAt(b).position_m).squaredNorm();
    variance_m2 += to.variance_m2 - from.variance_m2 + turn_rad2 * distance_m2 + scale_m * scale_m;
    variance_rad2 += turn_rad2;
  }

  // Returns true if the place that `a` proposes agrees with the measurement of `b`.
  bool Agree(const Proposal& a, const Proposal& b) const {
    double variance_m2 = a.variance_m2 + b.variance_m2;
    double variance_rad2 = a.variance_rad2 + b.variance_rad2;
    AddDrift(a.node, b.node, variance_m2, variance_rad2);
    AddDrift(a.other, b.other, variance_m2, variance_rad2);
    // An error of the yaw of `a` moves the node of `b` about the node of `a`.
    const Eigen::Vector3d lever_m = PoseAt(b.node).position_m - PoseAt(a.node).position_m;
    variance_m2 += a.variance_rad2 * lever_m.squaredNorm();
    const Eigen::Vector3d gap_m = a.motion * PoseAt(b.node).position_m - b.motion * PoseAt(b.node).position_m;
    if (gap_m.norm() > kAgreementSigmas * std::sqrt(variance_m2)) return false;
    if (!a.has_yaw || !b.has_yaw) return true;
    const double turn_rad = std::remainder(a.motion.Yaw() - b.motion.Yaw(), 2 * M_PI);
    return std::abs(turn_rad) <= kAgreementSigmas * std::sqrt(variance_rad2);
  }

  // The best proposal of a rover. `votes`: number of agreeing measurements, itself included.
  struct Best {
    std::size_t rover = 0;
    Pose motion;
    std::size_t votes = 0;
    bool suffices = false;
  };

  Best FindBest(std::size_t rover) const {
    const std::vector<Proposal> proposals = FindProposals(rover);
    Best best;
    best.rover = rover;
    for (const Proposal& proposal : proposals) {
      std::size_t votes = 0;
      bool has_second = proposal.IsPrior();
      for (const Proposal& other : proposals) {
        if (!Agree(proposal, other)) continue;
        ++votes;
        has_second = has_second || other.IsPrior() || other.node != proposal.node || other.other != proposal.other;
      }
      if (std::pair(has_second, votes) <= std::pair(best.suffices, best.votes)) continue;
      best = {rover, proposal.motion, votes, has_second};
    }
    return best;
  }

  // Places the rover whose best proposal has the most votes. Returns false if none can be placed.
  bool PlaceBest() {
    std::optional<Best> best;
    for (const std::size_t i : unknown_) {
      if (is_placed_[i]) continue;
      const Best found = FindBest(i);
      if (found.suffices && (!best || found.votes > best->votes)) best = found;
    }
    if (!best) return false;
    const Rover& rover = rovers_[best->rover];
    if (IsMove(rover, best->motion)) {
      for (std::size_t node = rover.first; node < rover.first + rover.count; ++node) {
        result_.initial.poses[node] = best->motion * result_.initial.poses[node];
      }
    }
    is_placed_[best->rover] = true;
    result_.placed.insert(rover.agent);
    return true;
  }

  // Returns false if the motion is within the accuracy of a placement. The rover's initial poses, which may be those of
  // the last solution, are then better.
  bool IsMove(const Rover& rover, const Pose& motion) const {
    if (std::abs(motion.Yaw()) > kSameYaw_rad) return true;
    for (std::size_t node = rover.first; node < rover.first + rover.count; ++node) {
      if ((motion * PoseAt(node).position_m - PoseAt(node).position_m).norm() > kApart_m) return true;
    }
    return false;
  }

  // Declares the rover with the most loop closures to others placed where it is. Returns false if there is none.
  bool StandOne() {
    const auto most = std::max_element(closures_of_.begin(), closures_of_.end(),
                                       [](const auto& a, const auto& b) { return a.size() < b.size(); });
    if (most == closures_of_.end() || most->empty()) return false;
    is_placed_[static_cast<std::size_t>(most - closures_of_.begin())] = true;
    return true;
  }

  std::string WhyNot(std::size_t rover) const {
    const std::size_t count = FindProposals(rover).size();
    if (count == 0 && !priors_of_[rover].empty())
      return "its position priors do not determine its heading: they lie within 1 m";
    if (count == 0) return "its loop closures lead to no placed rover";
    if (count == 1) return "one loop closure joins it to placed rovers; two that agree are needed";
    return "no two of its " + std::to_string(count) + " loop closures to placed rovers agree";
  }

  const CheckedGraph& graph_;
  const std::vector<Rover>& rovers_;
  const std::vector<std::size_t>& unknown_;
  std::map<AgentId, std::size_t> rover_of_;
  std::vector<bool> is_placed_;                                  // In the order of rovers_, like the two below.
  std::vector<std::vector<const CheckedClosure*>> closures_of_;  // Loop closures to other rovers.
  std::vector<std::vector<const CheckedPrior*>> priors_of_;
  std::vector<Drift> drift_;  // In the order of CheckedGraph::nodes.
  PosePlacement result_;
};

}  // namespace

std::vector<std::size_t> FindRoversToPlace(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                           const std::vector<StartPrior>& starts) {
  std::set<AgentId> measured;
  for (const CheckedClosure& closure : graph.closures) {
    const AgentId from = closure.edge->from.agent;
    const AgentId to = closure.edge->to.agent;
    if (from != to) measured.insert({from, to});
  }
  for (const CheckedPrior& prior : graph.priors) measured.insert(prior.prior->node.agent);
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < rovers.size(); ++i) {
    if (!starts[i].is_configured && measured.contains(rovers[i].agent)) found.push_back(i);
  }
  return found;
}

PosePlacement PlaceByPoses(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                           const std::vector<StartPrior>& starts, const std::vector<std::size_t>& unknown,
                           const InitialValues& initial) {
  return Placer(graph, rovers, starts, unknown, initial).Run();
}

}  // namespace moondb
