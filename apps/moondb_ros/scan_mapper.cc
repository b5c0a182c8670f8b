#include "apps/moondb_ros/scan_mapper.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

namespace moondb {
namespace {

constexpr std::int32_t kScanMapSide_cells = 100;
constexpr std::array<std::uint32_t, 4> kResolutions_um = {50'000, 100'000, 200'000, 400'000};
constexpr double kDurationMax_s = 10;            // The duration of a scan.
constexpr std::size_t kNodeRaysMax = 2'000'000;  // Further scans of a node are left out.

// One ray in the node's frame.
struct Ray {
  Eigen::Vector2d start_m;
  Eigen::Vector2d end_m;
  bool is_hit = false;
};

// Counts the rays that enter and end in each cell of one layer.
class RayCounts {
 public:
  explicit RayCounts(std::uint32_t resolution_um)
      : cell_m_(resolution_um * 1e-6), cells_(static_cast<std::size_t>(kScanMapSide_cells) * kScanMapSide_cells) {}

  void Add(const Ray& ray) {
    // Walks from cell to cell along the ray (Amanatides and Woo, 1987). Units are cells, from the lower left corner.
    const Eigen::Vector2d start = ray.start_m / cell_m_ + Eigen::Vector2d::Constant(kScanMapSide_cells / 2.0);
    const Eigen::Vector2d end = ray.end_m / cell_m_ + Eigen::Vector2d::Constant(kScanMapSide_cells / 2.0);
    const Eigen::Vector2d way = end - start;
    Eigen::Vector2i cell = start.array().floor().cast<int>();
    const Eigen::Vector2i last = end.array().floor().cast<int>();
    Eigen::Vector2i step;
    Eigen::Vector2d next;   // Part of the ray at which it leaves the cell, along each axis.
    Eigen::Vector2d delta;  // Part of the ray per cell.
    for (int axis = 0; axis < 2; ++axis) {
      step[axis] = way[axis] >= 0 ? 1 : -1;
      delta[axis] = way[axis] == 0 ? std::numeric_limits<double>::infinity() : 1 / std::abs(way[axis]);
      const double border = cell[axis] + (step[axis] > 0 ? 1 : 0);
      next[axis] = way[axis] == 0 ? std::numeric_limits<double>::infinity() : (border - start[axis]) / way[axis];
    }
    for (int left = (last - cell).cwiseAbs().sum(); left > 0; --left) {
      Enter(cell, /*is_end=*/false);
      const int axis = next.x() < next.y() ? 0 : 1;
      cell[axis] += step[axis];
      next[axis] += delta[axis];
      // A ray that has left the layer does not come back.
      if (step[axis] > 0 ? cell[axis] >= kScanMapSide_cells : cell[axis] < 0) return;
    }
    Enter(last, ray.is_hit);
  }

  Grid ToGrid() const {
    Grid grid(kScanMapSide_cells, kScanMapSide_cells);
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      if (cells_[i].entered_count == 0) continue;
      grid.cells[i] = 2 * cells_[i].ended_count >= cells_[i].entered_count ? Cell::kHazard : Cell::kFree;
    }
    return grid;
  }

 private:
  struct Count {
    std::uint32_t entered_count = 0;
    std::uint32_t ended_count = 0;
  };

  void Enter(const Eigen::Vector2i& cell, bool is_end) {
    if (cell.minCoeff() < 0 || cell.maxCoeff() >= kScanMapSide_cells) return;
    Count& count = cells_[static_cast<std::size_t>(cell.y()) * kScanMapSide_cells + static_cast<std::size_t>(cell.x())];
    ++count.entered_count;
    count.ended_count += is_end ? 1 : 0;
  }

  const double cell_m_;
  std::vector<Count> cells_;
};

// Cuts a ray that leaves the square of the coarsest layer, so that no ray takes more steps than that layer is wide.
constexpr double kReach_m = 1.5 * kScanMapSide_cells * 0.4;

void AddRays(const RosScan& scan, const Pose& node_from_first, const Pose& node_from_last, std::vector<Ray>& rays) {
  for (std::size_t i = 0; i < scan.ranges_m.size(); ++i) {
    const double range_m = scan.ranges_m[i];
    // Some drivers write 0 where nothing was hit.
    if (std::isnan(range_m) || range_m <= 0 || range_m < scan.range_min_m) continue;
    const double part = scan.ranges_m.size() < 2 ? 0 : static_cast<double>(i) / (scan.ranges_m.size() - 1.0);
    const Pose node_from_scanner = Interpolated(node_from_first, node_from_last, part);
    const double angle_rad = scan.angle_min_rad + static_cast<double>(i) * scan.angle_increment_rad;
    const bool is_hit = range_m < scan.range_max_m && range_m < kReach_m;
    const double length_m = std::min({range_m, scan.range_max_m, kReach_m});
    const Eigen::Vector3d end_m(length_m * std::cos(angle_rad), length_m * std::sin(angle_rad), 0);
    rays.push_back({node_from_scanner.position_m.head<2>(), (node_from_scanner * end_m).head<2>(), is_hit});
  }
}

}  // namespace

Result<void> ScanMapper::Add(RosScan scan) {
  if (scan.ranges_m.size() > kRaysMax) {
    return Fail(ErrorCode::kInvalid, "it has more than " + std::to_string(kRaysMax) + " rays");
  }
  const bool is_finite = std::isfinite(scan.angle_min_rad) && std::isfinite(scan.angle_increment_rad) &&
                         std::isfinite(scan.time_increment_s) && std::isfinite(scan.range_min_m) &&
                         std::isfinite(scan.range_max_m);
  const double duration_s = scan.time_increment_s * static_cast<double>(scan.ranges_m.size());
  if (!is_finite || duration_s > kDurationMax_s || scan.range_min_m < 0 || scan.range_max_m <= scan.range_min_m ||
      scan.time_increment_s < 0) {
    return Fail(ErrorCode::kInvalid, "its angles or the limits of its range are not valid");
  }
  const auto place = std::ranges::upper_bound(scans_, scan.timestamp_ns, {}, &RosScan::timestamp_ns);
  scans_.insert(place, std::move(scan));
  while (scans_.size() > kScansMax) scans_.pop_front();
  return {};
}

Result<TraversabilityMap> ScanMapper::MapAt(const PlannedNode& node, const OdometryTrack& track,
                                            const FrameTree& frames) const {
  const std::int64_t from_ns = node.timestamp_ns - static_cast<std::int64_t>(kScansUsed_s * 1e9);
  const Pose node_from_track = node.track_from_node.Inverse();
  bool is_any = false;
  std::vector<Ray> rays;
  for (const RosScan& scan : scans_) {
    if (scan.timestamp_ns <= from_ns || scan.timestamp_ns > node.timestamp_ns) continue;
    is_any = true;
    const double duration_s = scan.time_increment_s * static_cast<double>(scan.ranges_m.size());
    const std::optional<Pose> robot_from_scanner = frames.Find(track.child(), scan.frame, scan.timestamp_ns);
    const std::optional<Pose> first = track.PoseAt(scan.timestamp_ns);
    if (!robot_from_scanner || !first || robot_from_scanner->position_m.norm() > kReach_m) continue;
    if (rays.size() > kNodeRaysMax) break;
    // A scan that lasts longer than odometry was heard is taken as if the robot stood still after that.
    const std::optional<Pose> last = track.PoseAt(scan.timestamp_ns + static_cast<std::int64_t>(duration_s * 1e9));
    AddRays(scan, node_from_track * *first * *robot_from_scanner,
            node_from_track * last.value_or(*first) * *robot_from_scanner, rays);
  }
  if (rays.empty()) {
    return Fail(ErrorCode::kNotFound, is_any ? "no transform places its scans at the robot" : "no scan was heard");
  }
  TraversabilityMap map;
  for (const std::uint32_t resolution_um : kResolutions_um) {
    RayCounts counts(resolution_um);
    for (const Ray& ray : rays) counts.Add(ray);
    map.layers.push_back({counts.ToGrid(), resolution_um, 0, 0});
  }
  return map;
}

}  // namespace moondb
