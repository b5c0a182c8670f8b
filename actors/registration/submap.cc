#include "actors/registration/submap.h"

#include <xxhash.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>

namespace moondb {
namespace {

constexpr double kMapReach_m = 9;
constexpr std::uint32_t kFinest_um = 100'000;
constexpr int kHazardPercent = 40;
constexpr int kFreePercent = 15;
constexpr int kNormalCells = 5;           // Radius about a point in which its wall is looked for.
constexpr int kWallGap_cells = 3;         // A wall ends at a wider gap.
constexpr double kStraightCosine = 0.97;  // The normals of a wall differ by at most 14 degrees.
constexpr double kWallRatio_max = 0.3;    // Spread across a wall, divided by that along it. A corner has more.

// Returns a layer of at least kFinest_um: a cell is a hazard if one of its parts is.
MapLayer Coarsened(const MapLayer& layer) {
  const std::int32_t factor = static_cast<std::int32_t>((kFinest_um + layer.resolution_um - 1) / layer.resolution_um);
  MapLayer coarse;
  coarse.resolution_um = layer.resolution_um * static_cast<std::uint32_t>(factor);
  coarse.grid = Grid((layer.grid.width + factor - 1) / factor, (layer.grid.height + factor - 1) / factor);
  const Eigen::Vector2d corner_m = CornerOf(layer);
  coarse.center_x_m = corner_m.x() + coarse.grid.width * coarse.resolution_m() / 2;
  coarse.center_y_m = corner_m.y() + coarse.grid.height * coarse.resolution_m() / 2;
  for (std::int32_t row = 0; row < layer.grid.height; ++row) {
    for (std::int32_t column = 0; column < layer.grid.width; ++column) {
      Cell& cell = coarse.grid.At(column / factor, row / factor);
      cell = std::max(cell, layer.grid.At(column, row));
    }
  }
  return coarse;
}

// Returns the layers of 10 to 20 cm, finest first.
std::vector<MapLayer> UsedLayers(const TraversabilityMap& map) {
  std::vector<MapLayer> used, finer;
  for (const MapLayer& layer : map.layers) {
    if (layer.resolution_um > HazardField::kCoarsestLayer_um) continue;
    if (layer.resolution_um < kFinest_um) {
      finer.push_back(layer);
    } else {
      used.push_back(layer);
    }
  }
  if (used.empty()) {
    for (const MapLayer& layer : finer) used.push_back(Coarsened(layer));
  }
  return used;
}

Cell ValueAt(const std::vector<MapLayer>& layers, const std::vector<Eigen::Vector2d>& corners_m,
             const Eigen::Vector2d& local_m) {
  for (std::size_t i = 0; i < layers.size(); ++i) {
    const Eigen::Vector2d cell = (local_m - corners_m[i]) / layers[i].resolution_m();
    const int column = static_cast<int>(std::floor(cell.x()));
    const int row = static_cast<int>(std::floor(cell.y()));
    const Grid& grid = layers[i].grid;
    if (column < 0 || row < 0 || column >= grid.width || row >= grid.height) continue;
    if (const Cell value = grid.At(column, row); value != Cell::kUnknown) return value;
  }
  return Cell::kUnknown;
}

SquareGrid GridOf(std::span<const Submap::Source> sources) {
  double reach_m = Submap::kCell_m;
  for (const Submap::Source& source : sources) {
    reach_m = std::max(reach_m, source.submap_from_local.position_m().cwiseAbs().maxCoeff() + kMapReach_m);
  }
  reach_m = std::min(reach_m, Submap::kSideMax_m / 2);
  return {2 * static_cast<int>(std::ceil(reach_m / Submap::kCell_m)), Submap::kCell_m};
}

struct Votes {
  std::uint16_t hazard = 0;
  std::uint16_t all = 0;
};

void AddVotes(const Submap::Source& source, const SquareGrid& grid, std::vector<Votes>& votes) {
  const std::vector<MapLayer> layers = UsedLayers(source.map);
  std::vector<Eigen::Vector2d> corners_m;
  for (const MapLayer& layer : layers) corners_m.push_back(CornerOf(layer));
  const Eigen::Isometry2d local_from_submap = source.submap_from_local.ToTransform().inverse();
  const Eigen::Vector2d origin_m = source.submap_from_local.position_m();
  const int last = grid.side_cells - 1;
  for (int y = std::max(0, grid.ToCell(origin_m.y() - kMapReach_m));
       y <= std::min(last, grid.ToCell(origin_m.y() + kMapReach_m)); ++y) {
    for (int x = std::max(0, grid.ToCell(origin_m.x() - kMapReach_m));
         x <= std::min(last, grid.ToCell(origin_m.x() + kMapReach_m)); ++x) {
      const Eigen::Vector2d point_m(grid.ToCenter_m(x), grid.ToCenter_m(y));
      if ((point_m - origin_m).squaredNorm() > kMapReach_m * kMapReach_m) continue;
      const Eigen::Vector2d local_m = local_from_submap * point_m;
      const bool is_masked = std::ranges::any_of(
          source.masked, [&](const MaskedDisc& disc) { return (local_m - disc.center_m).norm() <= disc.radius_m; });
      if (is_masked) continue;
      const Cell value = ValueAt(layers, corners_m, local_m);
      if (value == Cell::kUnknown) continue;
      Votes& at = votes[grid.IndexOf(x, y)];
      ++at.all;
      at.hazard += value == Cell::kHazard ? 1 : 0;
    }
  }
}

std::vector<Cell> Fuse(std::span<const Submap::Source> sources, const SquareGrid& grid) {
  std::vector<Votes> votes(grid.cell_count());
  for (const Submap::Source& source : sources) AddVotes(source, grid, votes);
  std::vector<Cell> cells(votes.size(), Cell::kUnknown);
  for (std::size_t i = 0; i < votes.size(); ++i) {
    if (votes[i].all == 0) continue;
    if (100 * votes[i].hazard >= kHazardPercent * votes[i].all) {
      cells[i] = Cell::kHazard;
    } else if (100 * votes[i].hazard <= kFreePercent * votes[i].all) {
      cells[i] = Cell::kFree;
    }
  }
  return cells;
}

// Returns the first node with at least this path; the size of the track if there is none.
std::size_t FirstAtLeast(const RoverTrack& track, double path_m) {
  std::size_t first = 0, end = track.size();
  while (first < end) {
    const std::size_t half = (first + end) / 2;
    if (track.path_m(half) < path_m) {
      first = half + 1;
    } else {
      end = half;
    }
  }
  return first;
}

std::uint64_t HashOf(const std::vector<TrackMap>& maps) {
  std::vector<std::uint64_t> keys;
  for (const TrackMap& map : maps) keys.insert(keys.end(), {map.key.stream.origin, map.key.stream.epoch, map.key.seq});
  return XXH64(keys.data(), keys.size() * sizeof(keys[0]), 0);
}

}  // namespace

std::vector<SubmapWindow> FindWindows(const RoverTrack& track, std::vector<TrackMap> maps,
                                      const SubmapWindowOptions& options) {
  std::ranges::sort(
      maps, [](const TrackMap& a, const TrackMap& b) { return std::tie(a.index, a.key) < std::tie(b.index, b.key); });
  const double length_m = track.path_m(track.size() - 1);
  std::vector<SubmapWindow> windows;
  std::set<std::size_t> middles;
  auto first = maps.begin();
  for (double begin_m = 0; begin_m == 0 || begin_m + options.spacing_m <= length_m; begin_m += options.spacing_m) {
    const double end_m = std::min(begin_m + options.length_m, length_m);
    SubmapWindow window;
    window.middle = std::min(FirstAtLeast(track, (begin_m + end_m) / 2), track.size() - 1);
    while (first != maps.end() && track.path_m(first->index) < begin_m) ++first;
    auto last = first;
    while (last != maps.end() && track.path_m(last->index) <= end_m) ++last;
    const auto all = static_cast<std::size_t>(last - first);
    const std::size_t count = std::min(all, options.maps_max);
    for (std::size_t i = 0; i < count; ++i) window.maps.push_back(first[static_cast<std::ptrdiff_t>(i * all / count)]);
    window.hash = HashOf(window.maps);
    if (!window.maps.empty() && middles.insert(window.middle).second) windows.push_back(std::move(window));
  }
  std::size_t stride = 1;
  while ((windows.size() + stride - 1) / stride > options.count_max) stride *= 2;
  std::vector<SubmapWindow> spread;
  for (std::size_t i = 0; i < windows.size(); i += stride) spread.push_back(std::move(windows[i]));
  std::ranges::reverse(spread);
  return spread;
}

Submap::Submap(std::span<const Source> sources)
    : grid_(GridOf(sources)), distances_([&] {
        const std::vector<Cell> cells = Fuse(sources, grid_);
        FindNormals(cells);
        FindWalls();
        return DistanceField(cells, grid_, kReach_m);
      }()) {}

// Fits a line to the hazards about each hazard.
void Submap::FindNormals(const std::vector<Cell>& cells) {
  for (int y = 0; y < grid_.side_cells; ++y) {
    for (int x = 0; x < grid_.side_cells; ++x) {
      if (cells[grid_.IndexOf(x, y)] != Cell::kHazard) continue;
      double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0;
      for (int dy = -kNormalCells; dy <= kNormalCells; ++dy) {
        for (int dx = -kNormalCells; dx <= kNormalCells; ++dx) {
          if (dx * dx + dy * dy > kNormalCells * kNormalCells || !grid_.IsInside(x + dx, y + dy)) continue;
          if (cells[grid_.IndexOf(x + dx, y + dy)] != Cell::kHazard) continue;
          n += 1, sx += dx, sy += dy, sxx += dx * dx, sxy += dx * dy, syy += dy * dy;
        }
      }
      Eigen::Matrix2d spread;
      spread << sxx - sx * sx / n, sxy - sx * sy / n, sxy - sx * sy / n, syy - sy * sy / n;
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver;
      solver.computeDirect(spread);
      Point point{{grid_.ToCenter_m(x), grid_.ToCenter_m(y)}, solver.eigenvectors().col(0)};
      point.is_corner = solver.eigenvalues()(0) > kWallRatio_max * solver.eigenvalues()(1) || n <= 1;
      points_.push_back(point);
    }
  }
}

// Joins the points along each straight wall. A wall ends at a gap, at a corner, and where it bends.
void Submap::FindWalls() {
  std::vector<int> left(grid_.cell_count(), -1);  // By cell, the index of its point if it is in no wall yet.
  const auto cell_of = [&](const Point& point) {
    return std::pair(grid_.ToCell(point.position_m.x()), grid_.ToCell(point.position_m.y()));
  };
  const auto left_at = [&](const Point& point) -> int& {
    const auto [x, y] = cell_of(point);
    return left[grid_.IndexOf(x, y)];
  };
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (!points_[i].is_corner) left_at(points_[i]) = static_cast<int>(i);
  }
  std::vector<int> open;
  for (const Point& seed : points_) {
    if (left_at(seed) < 0) continue;
    open.assign(1, std::exchange(left_at(seed), -1));
    for (std::size_t next = 0; next < open.size(); ++next) {
      Point& point = points_[static_cast<std::size_t>(open[next])];
      point.wall = wall_count_;
      const auto [x, y] = cell_of(point);
      for (int dy = -kWallGap_cells; dy <= kWallGap_cells; ++dy) {
        for (int dx = -kWallGap_cells; dx <= kWallGap_cells; ++dx) {
          if (!grid_.IsInside(x + dx, y + dy)) continue;
          int& index = left[grid_.IndexOf(x + dx, y + dy)];
          if (index < 0) continue;
          if (std::abs(points_[static_cast<std::size_t>(index)].normal.dot(seed.normal)) < kStraightCosine) continue;
          open.push_back(std::exchange(index, -1));
        }
      }
    }
    ++wall_count_;
  }
}

}  // namespace moondb
