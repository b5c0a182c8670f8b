// HazardField: the hazards of one local traversability map, prepared for matching with other maps.
//
// A field is a square grid of 5 cm cells about the origin of the map's frame. It takes each cell from the finest layer
// that knows it. Layers coarser than 20 cm are not used, because their hazards are too blurred to be matched. A field
// has these parts:
// - points: the centres of the hazard cells, one for each cell of the layer it comes from, at most kPointsMax;
// - distances: from each cell to the nearest hazard, at most kDistanceMax_m;
// - likelihoods: how well a point fits a cell, and their maxima over squares of 2, 4, 8 and 16 cells for the search.
//
// Limits: a field covers the inner kFieldSideMax_m of the map. Immutable and usable on any thread.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "actors/registration/distance_field.h"
#include "model/traversability_map.h"

namespace moondb {

// A disc in the frame of a map, for example around another rover: its cells count as unknown.
struct MaskedDisc {
  Eigen::Vector2d center_m;
  double radius_m = 0;
};

// Returns at most `count_max` of the points, evenly spread over the list.
std::vector<Eigen::Vector2d> SamplePoints(const std::vector<Eigen::Vector2d>& points_m, std::size_t count_max);

struct FieldCell {
  std::int32_t column = 0;
  std::int32_t row = 0;
};

// A rectangle of cells from the first to the last, both included.
struct FieldBox {
  FieldCell first;
  FieldCell last;
};

class HazardField {
 public:
  static constexpr double kCell_m = 0.05;
  static constexpr std::uint32_t kCoarsestLayer_um = 200'000;
  static constexpr double kFieldSideMax_m = 40;
  static constexpr double kDistanceMax_m = 0.6;
  static constexpr std::size_t kPointsMax = 4000;
  static constexpr int kLevels = 5;  // Level k holds maxima over 2^k x 2^k cells.

  HazardField(const TraversabilityMap& map, std::span<const MaskedDisc> masked);

  // Hazard points in the frame of the map.
  const std::vector<Eigen::Vector2d>& points_m() const { return points_m_; }

  int side_cells() const { return grid_.side_cells; }
  int ToCell(double coordinate_m) const { return grid_.ToCell(coordinate_m); }

  // Returns the sum over the points of the largest likelihood, 0 to 255, of the 2^level x 2^level cells from the point
  // plus (column, row) on. `cells`: columns and rows of points; `box` contains them.
  std::uint32_t SumOfLikelihoods(int level, std::span<const FieldCell> cells, const FieldBox& box, int column,
                                 int row) const;

  const DistanceField& distances() const { return distances_; }
  DistanceField::Distance DistanceAt(const Eigen::Vector2d& point_m) const { return distances_.At(point_m); }

  std::size_t bytes() const;  // Memory use in bytes.

 private:
  static constexpr std::uint8_t kUnknownLikelihood = 64;  // 0.25
  static constexpr int kPadding = 1 << (kLevels - 1);

  std::vector<Cell> Draw(const TraversabilityMap& map, std::span<const MaskedDisc> masked);
  void FillLevels();

  const SquareGrid grid_;
  std::vector<Eigen::Vector2d> points_m_;
  DistanceField distances_;
  std::array<std::vector<std::uint8_t>, kLevels> levels_;
};

}  // namespace moondb
