#include "apps/moondb_mission/drive.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace moondb {

namespace {

constexpr double kWaitTurn_rad = 1.0;
constexpr double kSectorWeight_m = 6;    // Cost of a goal per radian outside the rover's sector.
constexpr double kCrowdDistance_m = 10;  // A goal costs more if another rover's goal is nearer than this.
constexpr double kCrowdWeight = 1.5;
constexpr double kGoalJitter_m = 3;
constexpr double kGoalLeast_m = 1;
constexpr double kLookAhead_m = 4;  // Route points beyond this distance are not tried as targets of a straight step.
constexpr double kDetour_m = 0.4;   // Added to the separation when a rover plans its route around other rovers.

double Wrap(double angle_rad) { return std::remainder(angle_rad, 2 * std::numbers::pi); }

struct RoverState {
  double sector_rad = 0;  // Direction of the middle of the rover's sector, seen from the base station.
  Eigen::Vector2d goal_m = Eigen::Vector2d::Zero();
  std::vector<Eigen::Vector2d> route;  // Remaining waypoints, the next one first.
  std::vector<TrackPoint> track;
  const Eigen::Vector2d& position_m() const { return track.back().position_m; }
};

class TeamDriver {
 public:
  TeamDriver(const Terrain& terrain, const DriveOptions& options, Random& random)
      : terrain_(terrain),
        options_(options),
        random_(random),
        routes_(terrain, options.rover_radius_m),
        is_seen_(routes_.cell_count(), 0) {}

  std::vector<std::vector<TrackPoint>> Drive() {
    Start();
    for (int node = 1; node < options_.node_count; ++node) Step(node);
    std::vector<std::vector<TrackPoint>> tracks;
    for (RoverState& rover : rovers_) tracks.push_back(std::move(rover.track));
    return tracks;
  }

 private:
  void Start() {
    const double sector_rad = 2 * std::numbers::pi / options_.rover_count;
    const double first_rad = random_.Uniform(0, 2 * std::numbers::pi);
    for (int i = 0; i < options_.rover_count; ++i) {
      RoverState rover;
      rover.sector_rad = first_rad + i * sector_rad;
      const Eigen::Vector2d outwards(std::cos(rover.sector_rad), std::sin(rover.sector_rad));
      rover.goal_m = terrain_.options().base_m + outwards * options_.start_radius_m;
      rover.track.push_back({rover.goal_m, Wrap(rover.sector_rad), 0});
      rovers_.push_back(std::move(rover));
      MarkSeen(rovers_.back().position_m());
    }
  }

  // Moves all rovers by one step. The rovers choose their steps one after another. The rover that chooses first changes
  // from node to node.
  void Step(int node) {
    const std::size_t count = rovers_.size();
    std::vector<Eigen::Vector2d> ends;
    for (const RoverState& rover : rovers_) ends.push_back(rover.position_m());
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t index = (i + node) % count;
      ends[index] = ChooseStep(index, ends);
    }
    for (std::size_t i = 0; i < count; ++i) {
      Arrive(rovers_[i], ends[i]);
      MarkSeen(ends[i]);
    }
  }

  // Returns the end of the rover's next step, or its current position if it must wait. Rovers that have not chosen yet
  // count as stationary. They will avoid this rover's step when they choose.
  Eigen::Vector2d ChooseStep(std::size_t index, const std::vector<Eigen::Vector2d>& ends) {
    RoverState& rover = rovers_[index];
    for (int attempt = 0; attempt < 2; ++attempt) {
      if (rover.route.empty()) PlanRoute(index);
      const Eigen::Vector2d end_m = StepAlongRoute(rover);
      if (IsApart(index, end_m, ends)) return end_m;
      rover.route.clear();
    }
    return rover.position_m();
  }

  // Returns the end of one straight step towards the farthest route point that can be reached in a straight line.
  // Removes the route points that this step skips.
  Eigen::Vector2d StepAlongRoute(RoverState& rover) {
    if (rover.route.empty()) return rover.position_m();
    const double step_m = random_.Uniform(options_.step_min_m, options_.step_max_m);
    std::size_t target = 0;
    for (std::size_t i = 1; i < rover.route.size(); ++i) {
      if ((rover.route[i] - rover.position_m()).norm() > kLookAhead_m) break;
      if (routes_.IsOpenLine(rover.position_m(), rover.route[i])) target = i;
    }
    const Eigen::Vector2d way = rover.route[target] - rover.position_m();
    const bool is_reached = way.norm() <= step_m;
    const Eigen::Vector2d end_m = is_reached ? rover.route[target] : rover.position_m() + way * (step_m / way.norm());
    rover.route.erase(rover.route.begin(),
                      rover.route.begin() + static_cast<std::ptrdiff_t>(is_reached ? target + 1 : target));
    return end_m;
  }

  bool IsApart(std::size_t index, const Eigen::Vector2d& end_m, const std::vector<Eigen::Vector2d>& ends) const {
    for (std::size_t i = 0; i < rovers_.size(); ++i) {
      if (i == index) continue;
      if (LeastDistance(rovers_[index].position_m(), end_m, rovers_[i].position_m(), ends[i]) < options_.separation_m) {
        return false;
      }
    }
    return true;
  }

  void PlanRoute(std::size_t index) {
    RoverState& rover = rovers_[index];
    std::vector<Disc> others;
    for (std::size_t i = 0; i < rovers_.size(); ++i) {
      if (i != index) others.push_back({rovers_[i].position_m(), options_.separation_m + kDetour_m});
    }
    const RouteMap::Ways ways = routes_.FindWays(rover.position_m(), others);
    const int goal = ChooseGoal(index, ways);
    if (goal < 0) return;
    rover.goal_m = routes_.CenterOf(goal);
    rover.route = routes_.RouteTo(goal, ways);
  }

  // Returns the unseen cell with the lowest cost. The cost is low for a short path inside the rover's sector and away
  // from other rovers' goals. Returns a random cell if all cells have been seen.
  int ChooseGoal(std::size_t index, const RouteMap::Ways& ways) {
    int best = -1;
    double best_cost = 1e300;
    bool is_best_unseen = false;
    for (int cell = 0; cell < routes_.cell_count(); ++cell) {
      if (!(ways.length_m[cell] < 1e9f) || ways.length_m[cell] < kGoalLeast_m) continue;
      const bool is_unseen = is_seen_[cell] == 0;
      if (is_best_unseen && !is_unseen) continue;
      const double cost = is_unseen ? GoalCost(index, cell, ways.length_m[cell]) : random_.Uniform(0, 1e6);
      if (cost < best_cost || (is_unseen && !is_best_unseen)) {
        best = cell;
        best_cost = cost;
        is_best_unseen = is_unseen;
      }
    }
    return best;
  }

  double GoalCost(std::size_t index, int cell, double length_m) {
    const Eigen::Vector2d goal_m = routes_.CenterOf(cell);
    const Eigen::Vector2d from_base = goal_m - terrain_.options().base_m;
    const double beside_rad = std::abs(Wrap(std::atan2(from_base.y(), from_base.x()) - rovers_[index].sector_rad)) -
                              std::numbers::pi / options_.rover_count;
    double cost = length_m + kSectorWeight_m * std::max(0.0, beside_rad) + random_.Uniform(0, kGoalJitter_m);
    for (std::size_t i = 0; i < rovers_.size(); ++i) {
      if (i == index) continue;
      cost += kCrowdWeight * std::max(0.0, kCrowdDistance_m - (rovers_[i].goal_m - goal_m).norm());
    }
    return cost;
  }

  // Turns the rover on the spot, then moves it to the end of the step. A waiting rover turns to look around.
  void Arrive(RoverState& rover, const Eigen::Vector2d& end_m) {
    TrackPoint& last = rover.track.back();
    const Eigen::Vector2d step = end_m - last.position_m;
    const bool is_waiting = step.norm() < 1e-9;
    last.turn_rad = is_waiting ? random_.Uniform(-kWaitTurn_rad, kWaitTurn_rad)
                               : Wrap(std::atan2(step.y(), step.x()) - last.yaw_rad);
    rover.track.push_back({end_m, Wrap(last.yaw_rad + last.turn_rad), 0});
  }

  void MarkSeen(const Eigen::Vector2d& position_m) {
    for (int cell = 0; cell < routes_.cell_count(); ++cell) {
      if ((routes_.CenterOf(cell) - position_m).squaredNorm() < options_.seen_radius_m * options_.seen_radius_m) {
        is_seen_[cell] = 1;
      }
    }
  }

  const Terrain& terrain_;
  DriveOptions options_;
  Random& random_;
  RouteMap routes_;
  std::vector<char> is_seen_;
  std::vector<RoverState> rovers_;
};

}  // namespace

double LeastDistance(const Eigen::Vector2d& a, const Eigen::Vector2d& a_end, const Eigen::Vector2d& b,
                     const Eigen::Vector2d& b_end) {
  // Seen from b, a moves along a straight line.
  const Eigen::Vector2d start = a - b;
  const Eigen::Vector2d motion = (a_end - b_end) - start;
  const double length_squared = motion.squaredNorm();
  const double nearest = length_squared > 0 ? std::clamp(-start.dot(motion) / length_squared, 0.0, 1.0) : 0;
  return (start + nearest * motion).norm();
}

std::vector<std::vector<TrackPoint>> DriveTeam(const Terrain& terrain, const DriveOptions& options, Random& random) {
  return TeamDriver(terrain, options, random).Drive();
}

}  // namespace moondb
