#include "model/metrics.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

namespace moondb {

namespace {

constexpr int kToleranceCellsMax = 100;

// The hazard cells of a map, dilated by the tolerance on every side. A single look-up then tests whether a hazard is
// nearby.
class NearHazards {
 public:
  NearHazards(const MergedMap& map, int tolerance)
      : left_(map.origin_cell_x - tolerance),
        bottom_(map.origin_cell_y - tolerance),
        near_(map.grid.width + 2 * tolerance, map.grid.height + 2 * tolerance) {
    // Dilate along x first, then along y.
    Grid rows(near_.width, map.grid.height);
    for (std::int32_t row = 0; row < map.grid.height; ++row) {
      for (std::int32_t column = 0; column < map.grid.width; ++column) {
        if (map.grid.At(column, row) != Cell::kHazard) continue;
        for (int step = 0; step <= 2 * tolerance; ++step) rows.At(column + step, row) = Cell::kHazard;
      }
    }
    for (std::int32_t row = 0; row < rows.height; ++row) {
      for (std::int32_t column = 0; column < rows.width; ++column) {
        if (rows.At(column, row) != Cell::kHazard) continue;
        for (int step = 0; step <= 2 * tolerance; ++step) near_.At(column, row + step) = Cell::kHazard;
      }
    }
  }

  bool Has(std::int64_t cell_x, std::int64_t cell_y) const {
    const std::int64_t column = cell_x - left_;
    const std::int64_t row = cell_y - bottom_;
    if (column < 0 || row < 0 || column >= near_.width || row >= near_.height) return false;
    return near_.At(static_cast<std::int32_t>(column), static_cast<std::int32_t>(row)) == Cell::kHazard;
  }

 private:
  std::int64_t left_;
  std::int64_t bottom_;
  Grid near_;
};

Cell CellAt(const MergedMap& map, std::int64_t cell_x, std::int64_t cell_y) {
  const std::int64_t column = cell_x - map.origin_cell_x;
  const std::int64_t row = cell_y - map.origin_cell_y;
  if (column < 0 || row < 0 || column >= map.grid.width || row >= map.grid.height) return Cell::kUnknown;
  return map.grid.At(static_cast<std::int32_t>(column), static_cast<std::int32_t>(row));
}

template <typename Visit>
void ForEachCell(const MergedMap& map, Visit visit) {
  for (std::int32_t row = 0; row < map.grid.height; ++row) {
    for (std::int32_t column = 0; column < map.grid.width; ++column) {
      visit(map.origin_cell_x + column, map.origin_cell_y + row, map.grid.At(column, row));
    }
  }
}

struct Share {
  std::uint64_t hazard_count = 0;
  std::uint64_t matched_count = 0;
  double Ratio() const { return hazard_count == 0 ? 1.0 : static_cast<double>(matched_count) / hazard_count; }
};

// Counts the hazards of `map`, and how many of them have a hazard of `other` within the tolerance.
Share MatchHazards(const MergedMap& map, const MergedMap& other, int tolerance) {
  const NearHazards near(other, tolerance);
  Share share;
  ForEachCell(map, [&](std::int64_t x, std::int64_t y, Cell cell) {
    if (cell != Cell::kHazard) return;
    ++share.hazard_count;
    if (near.Has(x, y)) ++share.matched_count;
  });
  return share;
}

// Computes Cohen's kappa of `map` and `truth` for the classes free and hazard: the agreement beyond that expected by
// chance.
void CountKappa(const MergedMap& map, const MergedMap& truth, MapAgreement& agreement) {
  double both = 0, agree = 0, map_hazards = 0, true_hazards = 0;
  ForEachCell(map, [&](std::int64_t x, std::int64_t y, Cell cell) {
    if (cell == Cell::kUnknown) return;
    const Cell true_cell = CellAt(truth, x, y);
    if (true_cell == Cell::kUnknown) return;
    both += 1;
    if (cell == true_cell) agree += 1;
    if (cell == Cell::kHazard) map_hazards += 1;
    if (true_cell == Cell::kHazard) true_hazards += 1;
  });
  agreement.known_in_both_count = static_cast<std::uint64_t>(both);
  if (both == 0) return;
  const double by_chance = (map_hazards * true_hazards + (both - map_hazards) * (both - true_hazards)) / (both * both);
  const double observed = agree / both;
  agreement.kappa = observed >= 1 ? 1 : (observed - by_chance) / (1 - by_chance);
}

// Returns the best-fitting rotation, from the covariance of centred points (Umeyama 1991, equations 40 to 43).
Eigen::Quaterniond Rotation(const Eigen::Matrix3d& covariance) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs(1, 1, 1);
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0) signs.z() = -1;
  return Eigen::Quaterniond(Eigen::Matrix3d(svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose()))
      .normalized();
}

// Returns the best-fitting rotation about the z axis, from the covariance of centred points.
Eigen::Quaterniond PlanarRotation(const Eigen::Matrix3d& covariance) {
  const double yaw = std::atan2(covariance(1, 0) - covariance(0, 1), covariance(0, 0) + covariance(1, 1));
  return Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()));
}

Result<void> CheckComparable(const MergedMap& map, const MergedMap& truth, int tolerance_cells) {
  if (map.resolution_um != truth.resolution_um) return Fail(ErrorCode::kInvalid, "the maps' resolutions differ");
  if (tolerance_cells < 0 || tolerance_cells > kToleranceCellsMax) {
    return Fail(ErrorCode::kInvalid, "must be 0 to 100", "tolerance_cells");
  }
  return {};
}

}  // namespace

TrajectoryError CompareTrajectories(const std::map<NodeKey, Pose>& estimate, const std::map<NodeKey, Pose>& truth,
                                    const std::vector<AgentId>& agents) {
  TrajectoryError error;
  double squared_sum = 0;
  for (const auto& [key, true_pose] : truth) {
    if (std::find(agents.begin(), agents.end(), key.agent) == agents.end()) continue;
    const auto pose = estimate.find(key);
    if (pose == estimate.end()) {
      ++error.missing_count;
      continue;
    }
    const double distance_m = (pose->second.position_m - true_pose.position_m).norm();
    squared_sum += distance_m * distance_m;
    error.max_m = std::max(error.max_m, distance_m);
    ++error.node_count;
  }
  if (error.node_count > 0) error.rmse_m = std::sqrt(squared_sum / static_cast<double>(error.node_count));
  return error;
}

Pose FindAlignment(const std::map<NodeKey, Pose>& estimate, const std::map<NodeKey, Pose>& truth, bool is_planar) {
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> pairs;
  for (const auto& [key, pose] : estimate) {
    const auto found = truth.find(key);
    if (found != truth.end()) pairs.emplace_back(pose.position_m, found->second.position_m);
  }
  if (pairs.size() < 2) return {};
  Eigen::Vector3d from_mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d to_mean = Eigen::Vector3d::Zero();
  for (const auto& [from, to] : pairs) {
    from_mean += from / static_cast<double>(pairs.size());
    to_mean += to / static_cast<double>(pairs.size());
  }
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const auto& [from, to] : pairs) covariance += (to - to_mean) * (from - from_mean).transpose();
  Pose alignment;
  alignment.orientation = is_planar ? PlanarRotation(covariance) : Rotation(covariance);
  alignment.position_m = to_mean - alignment.orientation * from_mean;
  if (is_planar) alignment.position_m.z() = 0;
  return alignment;
}

std::map<NodeKey, Pose> PosesOf(const PoseGraph& graph) {
  std::map<NodeKey, Pose> poses;
  for (const GraphNode& node : graph.nodes) poses[node.key] = node.map_from_node;
  return poses;
}

Result<MapAgreement> CompareMaps(const MergedMap& map, const MergedMap& truth, int tolerance_cells) {
  if (auto valid = CheckComparable(map, truth, tolerance_cells); !valid) return tl::unexpected(valid.error());
  const Share found = MatchHazards(map, truth, tolerance_cells);
  const Share covered = MatchHazards(truth, map, tolerance_cells);
  MapAgreement agreement;
  agreement.map_hazard_count = found.hazard_count;
  agreement.true_hazard_count = covered.hazard_count;
  agreement.precision = found.Ratio();
  agreement.recall = covered.Ratio();
  const double sum = agreement.precision + agreement.recall;
  agreement.f1 = sum == 0 ? 0 : 2 * agreement.precision * agreement.recall / sum;
  agreement.hazard_iou = agreement.f1 / (2 - agreement.f1);
  CountKappa(map, truth, agreement);
  return agreement;
}

Result<std::vector<HazardMatch>> MatchHazardCells(const MergedMap& map, const MergedMap& truth, int tolerance_cells) {
  if (auto valid = CheckComparable(map, truth, tolerance_cells); !valid) return tl::unexpected(valid.error());
  if (map.grid.width != truth.grid.width || map.grid.height != truth.grid.height ||
      map.origin_cell_x != truth.origin_cell_x || map.origin_cell_y != truth.origin_cell_y) {
    return Fail(ErrorCode::kInvalid, "the maps do not cover the same cells");
  }
  const NearHazards near_map(map, tolerance_cells);
  const NearHazards near_truth(truth, tolerance_cells);
  std::vector<HazardMatch> matches;
  matches.reserve(map.grid.cells.size());
  ForEachCell(map, [&](std::int64_t x, std::int64_t y, Cell cell) {
    const Cell true_cell = CellAt(truth, x, y);
    const bool is_hit =
        (cell == Cell::kHazard && near_truth.Has(x, y)) || (true_cell == Cell::kHazard && near_map.Has(x, y));
    if (is_hit) return matches.push_back(HazardMatch::kHit);
    if (true_cell == Cell::kHazard) return matches.push_back(HazardMatch::kMissed);
    if (cell == Cell::kHazard) return matches.push_back(HazardMatch::kPhantom);
    const bool is_known = cell != Cell::kUnknown || true_cell != Cell::kUnknown;
    matches.push_back(is_known ? HazardMatch::kFree : HazardMatch::kUnknown);
  });
  return matches;
}

}  // namespace moondb
