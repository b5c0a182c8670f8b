#include "apps/moondb_mission/sensing.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace moondb {

namespace {

constexpr double kRayStep_rad = 0.0044;  // A quarter of a degree: 4 cm at 10 m.
// A patch covers kPatch_rad in direction and kPatch_m in distance. Samples in one patch share their depth error and
// misclassification.
constexpr double kPatch_rad = 0.035;
constexpr double kPatch_m = 0.5;
// Tolerance for slopes of lines of sight. A point counts as visible if the slope to the point is at least the steepest
// slope to any nearer point, minus this tolerance.
constexpr double kGrazingSlack = 1e-3;

struct Patch {
  double depth_error = 0;  // In standard deviations.
  bool is_missed = false;
  bool is_false = false;
};

struct Phantom {
  bool is_there = false;
  Eigen::Vector2d center_m = Eigen::Vector2d::Zero();  // In the frame `map`.
  double radius_m = 0;
};

class Camera {
 public:
  Camera(const Terrain& terrain, const Pose& map_from_camera, double turn_rad,
         const std::vector<Eigen::Vector2d>& other_rovers_m, const CameraOptions& options, Random& random)
      : terrain_(terrain),
        options_(options),
        eye_m_(map_from_camera.position_m.head<2>()),
        yaw_rad_(map_from_camera.Yaw()),
        first_rad_(std::min(0.0, turn_rad) - options.field_of_view_rad / 2),
        last_rad_(std::max(0.0, turn_rad) + options.field_of_view_rad / 2),
        patches_per_ray_(static_cast<int>(options.range_max_m / kPatch_m) + 1) {
    last_rad_ = std::min(last_rad_, first_rad_ + 2 * std::numbers::pi);
    eye_height_m_ = terrain.GroundM(eye_m_) + options.height_m;
    for (const Eigen::Vector2d& other : other_rovers_m) {
      if ((other - eye_m_).norm() < options.range_max_m + 1) others_m_.push_back(other);
    }
    DrawPatches(random);
    DrawPhantom(random);
  }

  // Calls `see` for every visible sample with the measured position (x, y in the camera's level frame) and whether the
  // sample looks like a hazard.
  template <typename See>
  void Sweep(See see) const {
    for (double angle = first_rad_; angle <= last_rad_; angle += kRayStep_rad) SweepRay(angle, see);
  }

 private:
  void DrawPatches(Random& random) {
    const int rays = static_cast<int>((last_rad_ - first_rad_) / kPatch_rad) + 1;
    patches_.resize(static_cast<std::size_t>(rays) * patches_per_ray_);
    for (std::size_t i = 0; i < patches_.size(); ++i) {
      const double distance_m = (static_cast<double>(i % patches_per_ray_) + 0.5) * kPatch_m;
      const double far = std::pow(distance_m / options_.range_max_m, 2);
      patches_[i].depth_error = random.Normal();
      patches_[i].is_missed = random.Chance(options_.miss_share * far);
      patches_[i].is_false = random.Chance(options_.false_share * far);
    }
  }

  void DrawPhantom(Random& random) {
    phantom_.is_there = random.Chance(options_.phantom_share);
    const double distance_m = random.Uniform(1.5, 0.7 * options_.range_max_m);
    const double angle = yaw_rad_ + random.Uniform(first_rad_, last_rad_);
    phantom_.center_m = eye_m_ + distance_m * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    phantom_.radius_m = random.Uniform(0.15, 0.35);
  }

  const Patch& PatchAt(double angle, double distance_m) const {
    const std::size_t ray = static_cast<std::size_t>((angle - first_rad_) / kPatch_rad);
    return patches_[ray * patches_per_ray_ + static_cast<std::size_t>(distance_m / kPatch_m)];
  }

  bool IsOtherRover(const Eigen::Vector2d& point) const {
    return std::any_of(others_m_.begin(), others_m_.end(), [&](const Eigen::Vector2d& other) {
      return (other - point).squaredNorm() < options_.rover_radius_m * options_.rover_radius_m;
    });
  }

  template <typename See>
  void SweepRay(double angle, See see) const {
    const Eigen::Vector2d direction(std::cos(yaw_rad_ + angle), std::sin(yaw_rad_ + angle));
    const Eigen::Vector2d seen_direction(std::cos(angle), std::sin(angle));
    double steepest = -1e9;  // Slope of the steepest line of sight so far.
    for (double distance_m = options_.range_min_m; distance_m < options_.range_max_m; distance_m += kTerrainCell_m) {
      const Eigen::Vector2d point = eye_m_ + distance_m * direction;
      const bool is_rover = IsOtherRover(point);
      const double height_m = is_rover ? terrain_.GroundM(point) + options_.rover_height_m : terrain_.SurfaceM(point);
      const double slope = (height_m - eye_height_m_) / distance_m;
      if (slope < steepest - kGrazingSlack) continue;
      steepest = std::max(steepest, slope);
      const Patch& patch = PatchAt(angle, distance_m);
      const double sigma_m = options_.depth_error_per_m * distance_m * distance_m;
      const double seeming_m = distance_m + sigma_m * patch.depth_error;
      if (seeming_m < options_.range_min_m) continue;
      see(seeming_m * seen_direction, is_rover || SeemsHazard(point, patch));
    }
  }

  bool SeemsHazard(const Eigen::Vector2d& point, const Patch& patch) const {
    if (phantom_.is_there && (point - phantom_.center_m).norm() < phantom_.radius_m) return true;
    return terrain_.IsHazard(point) ? !patch.is_missed : patch.is_false;
  }

  const Terrain& terrain_;
  const CameraOptions& options_;
  Eigen::Vector2d eye_m_;
  double eye_height_m_ = 0;
  double yaw_rad_;
  double first_rad_;
  double last_rad_;
  int patches_per_ray_;
  std::vector<Patch> patches_;
  Phantom phantom_;
  std::vector<Eigen::Vector2d> others_m_;
};

// Adds one sample to one layer of the map.
void Enter(const Eigen::Vector2d& point_m, bool is_hazard, double cells_per_m, Grid& grid) {
  const int column = static_cast<int>(std::floor(point_m.x() * cells_per_m)) + grid.width / 2;
  const int row = static_cast<int>(std::floor(point_m.y() * cells_per_m)) + grid.height / 2;
  if (column < 0 || row < 0 || column >= grid.width || row >= grid.height) return;
  Cell& cell = grid.At(column, row);
  if (is_hazard) {
    cell = Cell::kHazard;
  } else if (cell == Cell::kUnknown) {
    cell = Cell::kFree;
  }
}

}  // namespace

TraversabilityMap Sense(const Terrain& terrain, NodeKey node, const Pose& map_from_body, double turn_rad,
                        const std::vector<Eigen::Vector2d>& other_rovers_m, const CameraOptions& options,
                        Random& random) {
  TraversabilityMap map{node, Pose::FromPlanar(options.ahead_m, 0, 0), {}};
  std::vector<double> cells_per_m;
  for (int layer = 0; layer < options.layer_count; ++layer) {
    const std::uint32_t resolution_um = options.finest_resolution_um << layer;
    map.layers.push_back(MapLayer{Grid(options.cells_per_side, options.cells_per_side), resolution_um, 0, 0});
    cells_per_m.push_back(1e6 / resolution_um);
  }
  const Camera camera(terrain, map_from_body * map.node_from_map, turn_rad, other_rovers_m, options, random);
  camera.Sweep([&](const Eigen::Vector2d& point_m, bool is_hazard) {
    for (std::size_t layer = 0; layer < map.layers.size(); ++layer) {
      Enter(point_m, is_hazard, cells_per_m[layer], map.layers[layer].grid);
    }
  });
  return map;
}

}  // namespace moondb
