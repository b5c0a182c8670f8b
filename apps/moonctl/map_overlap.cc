#include "apps/moonctl/map_overlap.h"

#include <algorithm>
#include <cmath>

#include "actors/registration/hazard_field.h"
#include "apps/common/table.h"

namespace moondb {
namespace {

constexpr std::uint32_t kCell_um = 50'000;
constexpr double kCell_m = kCell_um * 1e-6;
constexpr double kReach_m = 30;  // Bounds the raster to 1200 x 1200 cells.
constexpr double kMargin_m = 0.5;

enum CellClass : std::uint8_t { kUnknownCell, kFreeCell, kFirstHazard, kSecondHazard, kBothHazards };

// A rectangle along the axes.
struct Box {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(INFINITY);
  Eigen::Vector2d high = Eigen::Vector2d::Constant(-INFINITY);

  void Add(const Eigen::Vector2d& point_m) {
    low = low.cwiseMin(point_m);
    high = high.cwiseMax(point_m);
  }
};

// Returns the area of all known cells in the frame of the map. A map without known cells has a single point.
Box BoxOf(const TraversabilityMap& map) {
  Box box;
  for (const MapLayer& layer : map.layers) {
    const double resolution_m = layer.resolution_m();
    for (std::int32_t row = 0; row < layer.grid.height; ++row) {
      for (std::int32_t column = 0; column < layer.grid.width; ++column) {
        if (layer.grid.At(column, row) == Cell::kUnknown) continue;
        box.Add(CornerOf(layer) + resolution_m * Eigen::Vector2d(column, row));
        box.Add(CornerOf(layer) + resolution_m * Eigen::Vector2d(column + 1, row + 1));
      }
    }
  }
  if (box.low.x() > box.high.x()) box.Add(Eigen::Vector2d::Zero());
  return box;
}

Cell CellAt(const TraversabilityMap& map, const Eigen::Vector2d& point_m) {
  for (const MapLayer& layer : map.layers) {
    const Eigen::Vector2d at = (point_m - CornerOf(layer)) / (layer.resolution_m());
    if (at.x() < 0 || at.y() < 0 || at.x() >= layer.grid.width || at.y() >= layer.grid.height) continue;
    const Cell cell = layer.grid.At(static_cast<std::int32_t>(at.x()), static_cast<std::int32_t>(at.y()));
    if (cell != Cell::kUnknown) return cell;
  }
  return Cell::kUnknown;
}

CellClass ClassOf(Cell first, Cell second) {
  if (first == Cell::kHazard) return second == Cell::kHazard ? kBothHazards : kFirstHazard;
  if (second == Cell::kHazard) return kSecondHazard;
  return first == Cell::kFree || second == Cell::kFree ? kFreeCell : kUnknownCell;
}

std::string TitleOf(const std::string& name, const OverlapShare& share) {
  if (!share.ratio()) return name + ": no common hazards";
  return name + ": " + FormatFixed(*share.ratio() * 100, 0) + " % of " + std::to_string(share.common_count) +
         " hazards";
}

}  // namespace

std::optional<double> OverlapShare::ratio() const {
  if (common_count == 0) return std::nullopt;
  return static_cast<double>(matched_count) / static_cast<double>(common_count);
}

PlanarOffset OffsetOf(const OverlaidMaps& maps, const MapPlacement& placement) {
  return PlanarOffset::Between(placement.map_from_first_node * maps.first.node_from_map,
                               placement.map_from_second_node * maps.second.node_from_map);
}

OverlapShare MeasureOverlap(const OverlaidMaps& maps, const PlanarOffset& first_from_second) {
  const HazardField first(maps.first, {}), second(maps.second, {});
  const PlanarOffset second_from_first = first_from_second.Inverse();
  OverlapShare share;
  for (const Eigen::Vector2d& point_m : first.points_m()) {
    const DistanceField::Distance distance = second.DistanceAt(second_from_first * point_m);
    if (!distance.is_known) continue;
    ++share.common_count;
    share.matched_count += distance.distance_m <= kMatchedDistance_m ? 1 : 0;
  }
  return share;
}

Raster OverlapRaster(const OverlaidMaps& maps, const PlanarOffset& first_from_second) {
  const Box first = BoxOf(maps.first), second = BoxOf(maps.second);
  Box box = first;
  for (const double x : {second.low.x(), second.high.x()}) {
    for (const double y : {second.low.y(), second.high.y()}) box.Add(first_from_second * Eigen::Vector2d(x, y));
  }
  const Eigen::Vector2d middle = (first.low + first.high) / 2, reach = Eigen::Vector2d::Constant(kReach_m);
  const Eigen::Vector2d margin = Eigen::Vector2d::Constant(kMargin_m);
  box.low = (box.low - margin).cwiseMax(middle - reach);
  box.high = (box.high + margin).cwiseMin(middle + reach);

  Raster raster;
  raster.resolution_um = kCell_um;
  raster.origin_cell_x = static_cast<std::int64_t>(std::floor(box.low.x() / kCell_m));
  raster.origin_cell_y = static_cast<std::int64_t>(std::floor(box.low.y() / kCell_m));
  raster.width = static_cast<std::int32_t>(std::ceil(box.high.x() / kCell_m) - raster.origin_cell_x);
  raster.height = static_cast<std::int32_t>(std::ceil(box.high.y() / kCell_m) - raster.origin_cell_y);
  raster.classes = {{{255, 255, 255}, "unknown"},
                    {{222, 222, 222}, "free"},
                    {AgentColor(0), "hazard of " + maps.first_name},
                    {AgentColor(4), "hazard of " + maps.second_name},
                    {{0, 0, 0}, "hazard of both"}};
  const PlanarOffset second_from_first = first_from_second.Inverse();
  for (std::int32_t row = 0; row < raster.height; ++row) {
    for (std::int32_t column = 0; column < raster.width; ++column) {
      const Eigen::Vector2d at((raster.origin_cell_x + column + 0.5) * kCell_m,
                               (raster.origin_cell_y + row + 0.5) * kCell_m);
      raster.cells.push_back(ClassOf(CellAt(maps.first, at), CellAt(maps.second, second_from_first * at)));
    }
  }
  return raster;
}

Picture OverlapPicture(const OverlaidMaps& maps, const std::vector<MapPlacement>& placements, double north_yaw_rad) {
  Picture picture;
  picture.north_yaw_rad = north_yaw_rad;
  for (const MapPlacement& placement : placements) {
    const PlanarOffset offset = OffsetOf(maps, placement);
    picture.panels.push_back({TitleOf(placement.name, MeasureOverlap(maps, offset)), OverlapRaster(maps, offset), {}});
  }
  return picture;
}

}  // namespace moondb
