#include "actors/pgo/ground.h"

#include <algorithm>

namespace moondb {

namespace {

constexpr double kFirstTiltSigmas = 3;
// A rover's ground counts as level if the sum of the test statistic (ground.h) over n spans is at most kLimit * n +
// kLimitOfOne. On level ground, only one test in 100,000 exceeds this limit.
constexpr double kLimit = 2;
constexpr double kLimitOfOne = 12;

// Returns the squared tilt of a rotation: the squared horizontal component of the rotated vertical axis. For small
// angles the result is in rad^2.
double SquaredTilt(const Eigen::Quaterniond& turn) {
  return (turn.conjugate() * Eigen::Vector3d::UnitZ()).head<2>().squaredNorm();
}

// Returns the variance of the tilt from each node of the rover to the next, summed over both axes. 0 if no step joins
// the two nodes.
std::vector<double> StepVariances(const CheckedGraph& graph, const Rover& rover) {
  std::vector<double> variances(rover.count, 0);
  for (const CheckedOdometry& odometry : graph.odometry) {
    if (odometry.from < rover.first || odometry.to >= rover.first + rover.count) continue;
    if (odometry.to != odometry.from + 1) continue;
    variances[odometry.from - rover.first] = odometry.edge->covariance.diagonal().segment<2>(3).sum();
  }
  return variances;
}

bool IsLevelOverSpans(const CheckedGraph& graph, const Rover& rover, const std::vector<double>& variances,
                      std::size_t steps) {
  double sum = 0;
  double count = 0;
  for (std::size_t begin = 0; begin + steps < rover.count; begin += steps) {
    double variance = 0;
    bool is_joined = true;
    for (std::size_t step = begin; step < begin + steps; ++step) {
      is_joined = is_joined && variances[step] > 0;
      variance += variances[step];
    }
    if (!is_joined) continue;
    const Eigen::Quaterniond& from = graph.nodes[rover.first + begin].raw.orientation;
    const Eigen::Quaterniond& to = graph.nodes[rover.first + begin + steps].raw.orientation;
    sum += SquaredTilt(from.conjugate() * to) / variance;
    ++count;
  }
  return sum <= kLimit * count + kLimitOfOne;
}

bool IsLevel(const CheckedGraph& graph, const Rover& rover, double gravity_sigma_rad) {
  const double first_tilt_max = kFirstTiltSigmas * gravity_sigma_rad;
  if (SquaredTilt(graph.nodes[rover.first].raw.orientation) > first_tilt_max * first_tilt_max) return false;
  const std::vector<double> variances = StepVariances(graph, rover);
  if (std::none_of(variances.begin(), variances.end(), [](double variance) { return variance > 0; })) return false;
  for (std::size_t steps = 1; steps < rover.count; steps *= 2) {
    if (!IsLevelOverSpans(graph, rover, variances, steps)) return false;
  }
  return true;
}

}  // namespace

std::vector<bool> FindLevelGround(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                  double gravity_sigma_rad) {
  std::vector<bool> is_level;
  for (const Rover& rover : rovers) is_level.push_back(IsLevel(graph, rover, gravity_sigma_rad));
  return is_level;
}

}  // namespace moondb
