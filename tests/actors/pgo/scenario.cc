#include "tests/actors/pgo/scenario.h"

#include <cmath>
#include <random>

#include "model/metrics.h"

namespace moondb::simulation {

namespace {

constexpr std::int64_t kStep_ns = 10'000'000'000;
constexpr double kGravityNoise_rad = 0.01;
const Eigen::Vector2d kBase_m(5, 5);

class Generator {
 public:
  explicit Generator(const ScenarioOptions& options) : options_(options), rng_(options.seed) {}

  Scenario Make() {
    for (int i = 0; i < options_.rover_count; ++i) AddRover(static_cast<AgentId>(i + 1), ScaleErrorOf(i));
    if (options_.has_base_station) AddBaseStation(static_cast<AgentId>(options_.rover_count + 1));
    AddRanges();
    return std::move(scenario_);
  }

 private:
  double Noise(double sigma) { return sigma * normal_(rng_); }

  double ScaleErrorOf(int rover) const {
    const auto i = static_cast<std::size_t>(rover);
    return i < options_.scale_errors.size() ? options_.scale_errors[i] : 0;
  }

  // Returns a pose on hills that are 2 m high and 60 m apart. The pose's z axis is normal to the surface.
  static Pose OnGround(double x, double y, double yaw) {
    const double k = 2 * M_PI / 60;
    const double slope_x = 2 * k * std::cos(k * x);
    const double slope_y = -2 * k * std::sin(k * y);
    const Eigen::Vector3d normal = Eigen::Vector3d(-slope_x, -slope_y, 1).normalized();
    const Eigen::Vector3d forward(std::cos(yaw), std::sin(yaw), slope_x * std::cos(yaw) + slope_y * std::sin(yaw));
    Eigen::Matrix3d axes;
    axes << forward.normalized(), normal.cross(forward).normalized(), normal;
    return Pose{{x, y, 2 * std::sin(k * x) + 2 * std::cos(k * y)}, Eigen::Quaterniond(axes)};
  }

  static Eigen::Quaterniond Turn(const Eigen::Vector3d& angles) {
    return Eigen::Quaterniond(
        Eigen::AngleAxisd(angles.norm() + 1e-300, (angles + Eigen::Vector3d(0, 0, 1e-300)).normalized()));
  }

  void AddRover(AgentId agent, double scale_error) {
    double x = 12.0 * agent;
    double y = -8.0 * agent;
    double yaw = 0.7 * agent;
    double turn_per_m = 0.02;
    if (options_.is_around_base) {
      yaw = 2 * M_PI * agent / options_.rover_count;
      x = kBase_m.x() + 5 * std::cos(yaw);
      y = kBase_m.y() + 5 * std::sin(yaw);
      turn_per_m = 0.016;
    }
    Pose true_pose = OnGround(x, y, yaw);
    AgentFacts facts{agent, false, true_pose, options_.start_sigma_m, options_.start_sigma_rad, options_.antenna_m};
    const double sigma_m = options_.start_sigma_m;
    facts.start->position_m += Eigen::Vector3d(Noise(sigma_m), Noise(sigma_m), Noise(sigma_m));
    facts.start->orientation = facts.start->orientation * Turn({0, 0, Noise(options_.start_sigma_rad)});
    scenario_.agents[agent] = facts;
    Pose raw = *facts.start;
    for (int i = 0; i < options_.node_count; ++i) {
      const NodeKey key{agent, static_cast<std::uint64_t>(i)};
      if (i > 0) {
        yaw += options_.step_m * (0.06 * std::sin(0.11 * options_.step_m * i + agent) + turn_per_m);
        x += options_.step_m * std::cos(yaw);
        y += options_.step_m * std::sin(yaw);
        const Pose next = OnGround(x, y, yaw);
        raw = AddStep(key, true_pose.Inverse() * next, scale_error, raw);
        true_pose = next;
      }
      scenario_.truth[key] = true_pose;
      scenario_.graph.nodes.push_back(GraphNode{key, i * kStep_ns, WithTiltOf(raw, true_pose)});
    }
  }

  Pose AddStep(const NodeKey& to, const Pose& step, double scale_error, const Pose& raw) {
    OdometryEdge edge;
    edge.from = NodeKey{to.agent, to.index - 1};
    edge.to = to;
    edge.timestamp_ns = static_cast<std::int64_t>(to.index) * kStep_ns;
    edge.from_from_to.position_m =
        step.position_m / (1 + scale_error) +
        Eigen::Vector3d(Noise(options_.step_noise_m), Noise(options_.step_noise_m), Noise(options_.step_noise_m / 2));
    edge.from_from_to.orientation =
        step.orientation *
        Turn({Noise(options_.tilt_noise_rad), Noise(options_.tilt_noise_rad), Noise(options_.yaw_noise_rad)});
    const double tilt = options_.tilt_noise_rad * options_.tilt_noise_rad;
    const double yaw = options_.yaw_noise_rad * options_.yaw_noise_rad;
    const double step_variance = options_.step_noise_m * options_.step_noise_m;
    edge.covariance.diagonal() << step_variance, step_variance, step_variance / 4, tilt, tilt, yaw;
    scenario_.graph.odometry.push_back(edge);
    return raw * edge.from_from_to;
  }

  // Returns `raw` with the roll and pitch of `true_pose`, plus the noise of a gravity measurement.
  Pose WithTiltOf(const Pose& raw, const Pose& true_pose) {
    const double correction = raw.Yaw() - true_pose.Yaw();
    const Eigen::Quaterniond heading(Eigen::AngleAxisd(correction, Eigen::Vector3d::UnitZ()));
    const Eigen::Quaterniond noise = Turn({Noise(kGravityNoise_rad), Noise(kGravityNoise_rad), 0});
    return Pose{raw.position_m, heading * true_pose.orientation * noise};
  }

  void AddBaseStation(AgentId agent) {
    const Pose pose = OnGround(kBase_m.x(), kBase_m.y(), 0);
    scenario_.agents[agent] = AgentFacts{agent, true, pose, 0, 0, {0, 0, 1.5}};
    scenario_.graph.nodes.push_back(GraphNode{{agent, 0}, 0, pose});
    base_ = agent;
  }

  void AddRanges() {
    std::map<std::pair<AgentId, AgentId>, double> biases;
    for (int i = 0; i < options_.node_count; i += options_.range_every) {
      for (AgentId a = 1; a <= static_cast<AgentId>(options_.rover_count); ++a) {
        for (AgentId b = a + 1; b <= scenario_.agents.size(); ++b) {
          const auto [bias, is_new] = biases.try_emplace({a, b}, 0);
          if (is_new) bias->second = Noise(options_.bias_sigma_m);
          AddRange({a, static_cast<std::uint64_t>(i)}, {b, b == base_ ? 0 : static_cast<std::uint64_t>(i)},
                   i * kStep_ns, bias->second);
        }
      }
    }
  }

  void AddRange(const NodeKey& a, const NodeKey& b, std::int64_t timestamp_ns, double bias_m) {
    const double distance_m = (AntennaAt(a) - AntennaAt(b)).norm();
    const bool is_outlier = uniform_(rng_) < options_.outlier_ratio;
    const double excess_width_m = options_.outlier_max_m - options_.outlier_min_m;
    const double excess_m = is_outlier ? options_.outlier_min_m + excess_width_m * uniform_(rng_) : 0;
    const double range_m = std::max(0.0, distance_m + bias_m + excess_m + RangeNoise(a.agent, b.agent));
    scenario_.graph.ranges.push_back(
        RangeEdge{a, b, timestamp_ns, range_m, options_.range_sigma_m * options_.range_sigma_m});
    scenario_.is_outlier.push_back(is_outlier);
  }

  // Returns the noise of the pair's next range, drawn from a first-order autoregression. The noise is white if the
  // correlation is 0.
  double RangeNoise(AgentId a, AgentId b) {
    double& last_m = last_noise_m_[{a, b}];
    const double r = options_.correlation;
    last_m = r * last_m + std::sqrt(1 - r * r) * Noise(options_.range_sigma_m);
    return last_m;
  }

  Eigen::Vector3d AntennaAt(const NodeKey& key) const {
    const AgentFacts& facts = scenario_.agents.at(key.agent);
    return (facts.is_base_station ? *facts.start : scenario_.truth.at(key)) * facts.antenna_m;
  }

  const ScenarioOptions& options_;
  std::mt19937_64 rng_;
  std::normal_distribution<double> normal_;
  std::uniform_real_distribution<double> uniform_;
  Scenario scenario_;
  AgentId base_ = 0;
  std::map<std::pair<AgentId, AgentId>, double> last_noise_m_;
};

}  // namespace

Scenario MakeScenario(const ScenarioOptions& options) { return Generator(options).Make(); }

LoopClosure LoopClosureOf(const Scenario& scenario, const NodeKey& from, const NodeKey& to, const std::string& source,
                          std::mt19937_64& rng, const Eigen::Vector3d& offset_m) {
  std::normal_distribution<double> normal;
  LoopClosure closure{from, to, 0, scenario.truth.at(from).Inverse() * scenario.truth.at(to), {}, source};
  Eigen::Vector3d turn;
  for (int i = 0; i < 3; ++i) {
    closure.from_from_to.position_m[i] += kClosureSigma_m * normal(rng) + offset_m[i];
    turn[i] = kClosureSigma_rad * normal(rng);
  }
  closure.from_from_to.orientation =
      closure.from_from_to.orientation * Eigen::Quaterniond(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
  closure.covariance.setZero();
  closure.covariance.diagonal().head<3>().setConstant(kClosureSigma_m * kClosureSigma_m);
  closure.covariance.diagonal().tail<3>().setConstant(kClosureSigma_rad * kClosureSigma_rad);
  return closure;
}

NodePrior PriorOf(const Scenario& scenario, const NodeKey& node, PriorExtent extent, const std::string& source,
                  std::mt19937_64& rng) {
  std::normal_distribution<double> normal;
  NodePrior prior;
  prior.node = node;
  prior.extent = extent;
  prior.source = source;
  prior.map_from_node = scenario.truth.at(node);
  for (int i = 0; i < 3; ++i) prior.map_from_node.position_m[i] += kClosureSigma_m * normal(rng);
  prior.covariance.setZero();
  prior.covariance.diagonal().head<3>().setConstant(kClosureSigma_m * kClosureSigma_m);
  prior.covariance.diagonal().tail<3>().setConstant(kClosureSigma_rad * kClosureSigma_rad);
  return prior;
}

double TrajectoryErrorM(const Scenario& scenario, const std::map<NodeKey, Pose>& poses) {
  std::vector<AgentId> rovers;
  for (const auto& [agent, facts] : scenario.agents) {
    if (!facts.is_base_station) rovers.push_back(agent);
  }
  return CompareTrajectories(poses, scenario.truth, rovers).rmse_m;
}

}  // namespace moondb::simulation
