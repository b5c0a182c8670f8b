#include "apps/moondb_mission/mission_maker.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <system_error>

#include "model/file_writing.h"

namespace moondb {

namespace {

constexpr double kNsPerSecond = 1e9;
constexpr int kMapsMax = 20'000;
constexpr double kBaseOffset_m = 1.5;
constexpr double kStartZShare = 0.3;  // Sigma of z in a start pose, as a fraction of the sigma of x and y.
const Eigen::Vector3d kRoverAntenna_m(0.1, 0, 0.3);
const Eigen::Vector3d kBaseAntenna_m(0, 0, 1.5);

// Purposes of random streams. Add new purposes with new numbers: changing a number changes every mission.
enum Stream : std::uint64_t {
  kTerrainStream = 1,
  kDriveStream,
  kStartStream,
  kRangeStream,
  kOdometryStream = 100,
  kCameraStream = 200
};

Result<void> CheckBetween(double value, double least, double most, const char* name) {
  if (value >= least && value <= most) return {};
  char text[96];
  std::snprintf(text, sizeof(text), "must lie between %g and %g", least, most);
  return Fail(ErrorCode::kInvalid, text, name);
}

int NodeCount(const MissionOptions& options) {
  return static_cast<int>(std::floor(options.minutes * 60 / options.node_period_s + 1e-9)) + 1;
}

Result<void> CheckOptions(const MissionOptions& options) {
  Result<void> good = CheckBetween(options.minutes, 1, 600, "minutes");
  if (good) good = CheckBetween(options.node_period_s, 1, 600, "period_s");
  if (good) good = CheckBetween(options.rover_count, 1, 8, "rovers");
  if (good) good = CheckBetween(options.terrain.side_m, 15, 120, "side_m");
  if (good) good = CheckBetween(options.terrain.rock_area_share, 0.005, 0.1, "rock_share");
  if (good) good = CheckBetween(options.terrain.crater_share, 0, 2, "crater_share");
  if (good && NodeCount(options) * options.rover_count > kMapsMax) {
    return Fail(ErrorCode::kInvalid,
                "the mission would have more than " + std::to_string(kMapsMax) + " maps; make it shorter", "minutes");
  }
  return good;
}

Pose TruePose(const Terrain& terrain, const TrackPoint& point) {
  Pose pose = Pose::FromPlanar(point.position_m.x(), point.position_m.y(), point.yaw_rad);
  // The body's frame is level, because visual-inertial odometry observes the vertical.
  pose.position_m.z() = terrain.GroundM(point.position_m);
  return pose;
}

class Maker {
 public:
  explicit Maker(const MissionOptions& options)
      : options_(options), period_ns_(std::llround(options.node_period_s * kNsPerSecond)) {}

  MadeMission Make() {
    Random terrain_random = Random::Stream(options_.seed, kTerrainStream);
    TerrainOptions terrain_options = options_.terrain;
    terrain_options.base_m.x() = terrain_random.Uniform(-kBaseOffset_m, kBaseOffset_m);
    terrain_options.base_m.y() = terrain_random.Uniform(-kBaseOffset_m, kBaseOffset_m);
    MadeMission made{Terrain::Make(terrain_options, terrain_random), {}, {}};
    DriveOptions drive;
    drive.rover_count = options_.rover_count;
    drive.node_count = NodeCount(options_);
    Random drive_random = Random::Stream(options_.seed, kDriveStream);
    tracks_ = DriveTeam(made.terrain, drive, drive_random);
    Random start_random = Random::Stream(options_.seed, kStartStream);
    for (int rover = 0; rover < options_.rover_count; ++rover) AddRover(rover, start_random, made);
    AddBase(made);
    Random range_random = Random::Stream(options_.seed, kRangeStream);
    made.mission.graph.ranges = MeasureRanges(made.mission.agents, made.mission.truth, drive.node_count, period_ns_,
                                              options_.ranges, range_random);
    for (int rover = 0; rover < options_.rover_count; ++rover) AddMaps(rover, made);
    return made;
  }

 private:
  static AgentId IdOf(int rover) { return static_cast<AgentId>(rover + 1); }
  static char LetterOf(int rover) { return static_cast<char>('A' + rover); }

  void AddRover(int rover, Random& start_random, MadeMission& made) {
    Mission& mission = made.mission;
    std::vector<GraphNode> true_nodes;
    for (std::size_t node = 0; node < tracks_[rover].size(); ++node) {
      const Pose pose = TruePose(made.terrain, tracks_[rover][node]);
      true_nodes.push_back({{IdOf(rover), node}, static_cast<std::int64_t>(node) * period_ns_, pose});
      mission.truth[true_nodes.back().key] = pose;
    }
    MissionAgent agent;
    agent.id = IdOf(rover);
    agent.name = "rover" + std::to_string(rover + 1);
    agent.letter = LetterOf(rover);
    agent.antenna_m = kRoverAntenna_m;
    agent.start_sigma_m = options_.start_sigma_m;
    agent.start_sigma_rad = options_.start_sigma_rad;
    agent.start = GuessStart(true_nodes.front().map_from_node, start_random);
    Random odometry_random = Random::Stream(options_.seed, kOdometryStream + static_cast<std::uint64_t>(rover));
    const std::vector<OdometryEdge> steps = MeasureOdometry(true_nodes, options_.odometry, odometry_random);
    Pose raw = agent.start;
    for (std::size_t node = 0; node < true_nodes.size(); ++node) {
      if (node > 0) raw = raw * steps[node - 1].from_from_to;
      mission.graph.nodes.push_back({true_nodes[node].key, true_nodes[node].timestamp_ns, raw});
    }
    mission.graph.odometry.insert(mission.graph.odometry.end(), steps.begin(), steps.end());
    mission.agents.push_back(std::move(agent));
  }

  Pose GuessStart(const Pose& truth, Random& random) const {
    const double yaw_rad = truth.Yaw() + options_.start_sigma_rad * random.Normal();
    const double x_m = truth.position_m.x() + options_.start_sigma_m * random.Normal();
    const double y_m = truth.position_m.y() + options_.start_sigma_m * random.Normal();
    Pose start = Pose::FromPlanar(x_m, y_m, yaw_rad);
    start.position_m.z() = truth.position_m.z() + kStartZShare * options_.start_sigma_m * random.Normal();
    return start;
  }

  void AddBase(MadeMission& made) {
    MissionAgent base;
    base.id = IdOf(options_.rover_count);
    base.name = "base";
    base.is_base_station = true;
    base.letter = 'L';
    base.antenna_m = kBaseAntenna_m;
    base.start = TruePose(made.terrain, {made.terrain.options().base_m, 0, 0});
    const NodeKey key{base.id, 0};
    made.mission.truth[key] = base.start;
    made.mission.graph.nodes.push_back({key, 0, base.start});
    made.mission.agents.push_back(std::move(base));
  }

  void AddMaps(int rover, MadeMission& made) {
    Random random = Random::Stream(options_.seed, kCameraStream + static_cast<std::uint64_t>(rover));
    for (std::size_t node = 0; node < tracks_[rover].size(); ++node) {
      std::vector<Eigen::Vector2d> others;
      for (std::size_t other = 0; other < tracks_.size(); ++other) {
        if (static_cast<int>(other) != rover) others.push_back(tracks_[other][node].position_m);
      }
      const NodeKey key{IdOf(rover), node};
      // A rover looks all around before it sets out, so that the rovers' maps overlap at the base station.
      made.maps.push_back(Sense(made.terrain, key, made.mission.truth.at(key),
                                node == 0 ? 2 * std::numbers::pi : tracks_[rover][node].turn_rad, others,
                                options_.camera, random));
      char file[32];
      std::snprintf(file, sizeof(file), "maps/%c%04zu.png", LetterOf(rover), node);
      made.mission.maps.push_back(
          MissionMap{LetterOf(rover) + std::to_string(node), key.agent, static_cast<std::int64_t>(node) * period_ns_,
                     key, made.maps.back().node_from_map, options_.camera.layer_count, options_.camera.cells_per_side,
                     options_.camera.finest_resolution_um / 1e6, file});
    }
  }

  MissionOptions options_;
  std::int64_t period_ns_;
  std::vector<std::vector<TrackPoint>> tracks_;
};

}  // namespace

Result<MadeMission> MakeMission(const MissionOptions& options) {
  const Result<void> good = CheckOptions(options);
  if (!good) return tl::unexpected(good.error());
  return Maker(options).Make();
}

Result<void> WriteMadeMission(const MadeMission& made, const std::filesystem::path& folder) {
  std::error_code failure;
  if (std::filesystem::exists(folder, failure) && !std::filesystem::is_empty(folder, failure)) {
    return Fail(ErrorCode::kRefused, "exists already and is not empty", folder.string());
  }
  Result<void> done = WriteMission(made.mission, folder);
  if (!done) return done;
  failure = MakeFolders(folder / "maps");
  if (failure) return Fail(ErrorCode::kInternal, "cannot be made: " + failure.message(), (folder / "maps").string());
  for (std::size_t i = 0; i < made.maps.size() && done; ++i) {
    done = WriteMissionMap(folder / made.mission.maps[i].file, made.maps[i]);
  }
  return done;
}

}  // namespace moondb
