#include "apps/moondb_ros/grid_mapper.h"

#include <algorithm>
#include <cmath>
#include <string>

namespace moondb {
namespace {

constexpr std::int32_t kGridMapSide_cells = 100;
constexpr std::size_t kLayersMax = 4;
constexpr double kRotationMax_rad = 0.001;

Cell CellOf(std::int8_t value) {
  if (value == 100) return Cell::kHazard;
  return value == 0 ? Cell::kFree : Cell::kUnknown;
}

Result<void> CheckGrid(const RosGrid& grid) {
  const Result<Pose> origin = CheckedPose(grid.frame_from_origin);
  if (!origin) return tl::unexpected(origin.error());
  if (origin->orientation.angularDistance(Eigen::Quaterniond::Identity()) > kRotationMax_rad) {
    return Fail(ErrorCode::kInvalid, "its origin is rotated");
  }
  if (grid.width == 0 || grid.height == 0 || grid.width > kGridSideMax_cells || grid.height > kGridSideMax_cells) {
    return Fail(ErrorCode::kInvalid, "it has " + std::to_string(grid.width) + " x " + std::to_string(grid.height) +
                                         " cells; 1 to " + std::to_string(kGridSideMax_cells) + " a side are accepted");
  }
  if (grid.values.size() != std::size_t{grid.width} * grid.height) {
    return Fail(ErrorCode::kInvalid, "its data has " + std::to_string(grid.values.size()) + " cells, not " +
                                         std::to_string(grid.width) + " x " + std::to_string(grid.height));
  }
  if (!(grid.resolution_m >= 0.01 && grid.resolution_m <= 1)) {
    return Fail(ErrorCode::kInvalid, "its cells are not between 0.01 and 1 m");
  }
  if (std::ranges::any_of(grid.values, [](std::int8_t value) { return value < -1 || value > 100; })) {
    return Fail(ErrorCode::kInvalid, "a value is outside of -1 to 100");
  }
  return {};
}

// A grid whose cells are `cells_per_cell` cells of `fine` a side. A cell that lies partly outside of `fine` counts its
// part inside.
struct Coarser {
  const RosGrid& fine;
  std::int32_t cells_per_cell;

  Cell At(std::int64_t column, std::int64_t row) const {
    Cell found = Cell::kUnknown;
    for (std::int64_t y = row * cells_per_cell; y < (row + 1) * cells_per_cell; ++y) {
      for (std::int64_t x = column * cells_per_cell; x < (column + 1) * cells_per_cell; ++x) {
        if (x < 0 || y < 0 || x >= fine.width || y >= fine.height) continue;
        found = std::max(found, CellOf(fine.values[static_cast<std::size_t>(y) * fine.width + x]));
      }
    }
    return found;
  }
};

// The cells around `center_m`, which is relative to the lower left corner of the grid. The layer's center is relative
// to `center_m`, so that cells coincide with those of the grid.
MapLayer LayerAround(const RosGrid& grid, std::int32_t cells_per_cell, const Eigen::Vector2d& center_m) {
  const double cell_m = grid.resolution_m * cells_per_cell;
  const auto column = static_cast<std::int64_t>(std::llround(center_m.x() / cell_m)) - kGridMapSide_cells / 2;
  const auto row = static_cast<std::int64_t>(std::llround(center_m.y() / cell_m)) - kGridMapSide_cells / 2;
  MapLayer layer;
  layer.grid = Grid(kGridMapSide_cells, kGridMapSide_cells);
  layer.resolution_um = static_cast<std::uint32_t>(std::llround(cell_m * 1e6));
  const Coarser cells{grid, cells_per_cell};
  for (std::int32_t y = 0; y < kGridMapSide_cells; ++y) {
    for (std::int32_t x = 0; x < kGridMapSide_cells; ++x) layer.grid.At(x, y) = cells.At(column + x, row + y);
  }
  layer.center_x_m = static_cast<double>(column + kGridMapSide_cells / 2) * cell_m - center_m.x();
  layer.center_y_m = static_cast<double>(row + kGridMapSide_cells / 2) * cell_m - center_m.y();
  return layer;
}

// The robot's pose in a grid's frame at the node; nullopt if no transform joins the frames.
std::optional<Pose> FrameFromRobot(const std::string& frame, std::int64_t grid_ns, const PlannedNode& node,
                                   const OdometryTrack& track, const FrameTree& frames) {
  const Pose odom_from_robot = track.track_from_odom().Inverse() * node.track_from_node;
  if (frame == track.frame()) return odom_from_robot;
  if (frames.IsBelow(frame, track.child())) {
    // A frame on the robot: its grid lies where the robot was at the grid's time.
    const std::optional<Pose> frame_from_child = frames.Find(frame, track.child(), grid_ns);
    const std::optional<Pose> track_from_child = track.PoseAt(grid_ns);
    if (!frame_from_child || !track_from_child) return std::nullopt;
    return *frame_from_child * track_from_child->Inverse() * node.track_from_node;
  }
  const std::optional<Pose> frame_from_odom = frames.Find(frame, track.frame(), node.timestamp_ns);
  if (!frame_from_odom) return std::nullopt;
  return *frame_from_odom * odom_from_robot;
}

bool ContainsWhole(const MapLayer& layer, const RosGrid& grid, const Eigen::Vector2d& center_m) {
  const double half_m = layer.resolution_m() * kGridMapSide_cells / 2;
  const Eigen::Vector2d low = center_m + Eigen::Vector2d(layer.center_x_m - half_m, layer.center_y_m - half_m);
  const Eigen::Vector2d high = center_m + Eigen::Vector2d(layer.center_x_m + half_m, layer.center_y_m + half_m);
  const double cell_m = grid.resolution_m;  // Tolerance: a strip narrower than a cell.
  return low.maxCoeff() < cell_m && high.x() > (grid.width - 1.0) * cell_m && high.y() > (grid.height - 1.0) * cell_m;
}

}  // namespace

Result<void> GridMapper::Set(std::size_t topic, RosGrid grid) {
  if (const Result<void> checked = CheckGrid(grid); !checked) return checked;
  Topic& set = topics_[topic];
  const bool has_unknown = std::ranges::find(grid.values, std::int8_t{-1}) != grid.values.end();
  set.fully_known_count = has_unknown ? 0 : std::min(set.fully_known_count + 1, kFullyKnownMax);
  if (set.fully_known_count >= kFullyKnownMax) {
    set.newest.reset();
    return Fail(ErrorCode::kInvalid,
                std::to_string(kFullyKnownMax) +
                    " grids in turn had no unknown cell, so cells that no sensor saw count as free: set "
                    "track_unknown_space: true");
  }
  set.newest = std::move(grid);
  return {};
}

Result<TraversabilityMap> GridMapper::MapAt(const PlannedNode& node, const OdometryTrack& track,
                                            const FrameTree& frames) const {
  TraversabilityMap map;
  std::string frame;
  std::optional<Pose> frame_from_map;
  for (const Topic& topic : topics_) {
    if (!topic.newest) continue;
    const RosGrid& grid = *topic.newest;
    if (static_cast<double>(node.timestamp_ns - grid.timestamp_ns) * 1e-9 > kGridAgeMax_s) continue;
    if (track.JumpsUntil(grid.timestamp_ns) != track.JumpsUntil(track.newest_ns())) {
      return Fail(ErrorCode::kNotFound, "odometry jumped after its last grid");
    }
    if (!frame_from_map) {
      frame = grid.frame;
      const std::optional<Pose> frame_from_robot = FrameFromRobot(frame, grid.timestamp_ns, node, track, frames);
      if (!frame_from_robot) {
        return Fail(ErrorCode::kNotFound, "no transform joins its frame " + frame + " to " + track.child());
      }
      frame_from_map = Pose::FromPlanar(frame_from_robot->position_m.x(), frame_from_robot->position_m.y(), 0);
      frame_from_map->position_m.z() = frame_from_robot->position_m.z();
      map.node_from_map = frame_from_robot->Inverse() * *frame_from_map;
    } else if (grid.frame != frame) {
      return Fail(ErrorCode::kInvalid, "its grids have the frames " + frame + " and " + grid.frame);
    }
    const Eigen::Vector2d center_m = (frame_from_map->position_m - grid.frame_from_origin.position_m).head<2>();
    const std::size_t layers_max = topics_.size() == 1 ? kLayersMax : 1;
    for (std::size_t i = 0; i < layers_max; ++i) {
      map.layers.push_back(LayerAround(grid, 1 << i, center_m));
      if (ContainsWhole(map.layers.back(), grid, center_m)) break;
    }
  }
  if (map.layers.empty())
    return Fail(ErrorCode::kNotFound,
                "no grid was heard in the last " + std::to_string(static_cast<int>(kGridAgeMax_s)) + " s");
  std::ranges::stable_sort(map.layers, {}, &MapLayer::resolution_um);
  return map;
}

}  // namespace moondb
