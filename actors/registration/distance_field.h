// DistanceField: the distance from each cell of a square grid to the nearest hazard, for matching maps.
//
// The grid lies about the origin of the map's frame. Immutable and usable on any thread.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "model/grid.h"

namespace moondb {

// A square grid about the origin of a frame, with an even number of cells per side; row 0 has the smallest y.
struct SquareGrid {
  int side_cells = 0;
  double cell_m = 0;

  // Returns the column or row of a coordinate. It may lie outside of the grid.
  int ToCell(double coordinate_m) const { return static_cast<int>(std::floor(coordinate_m / cell_m)) + side_cells / 2; }
  // Returns the coordinate of the centre of a column or row.
  double ToCenter_m(int cell) const { return (cell - side_cells / 2 + 0.5) * cell_m; }
  bool IsInside(int column, int row) const {
    return column >= 0 && row >= 0 && column < side_cells && row < side_cells;
  }
  std::size_t IndexOf(int column, int row) const { return static_cast<std::size_t>(row) * side_cells + column; }
  std::size_t cell_count() const { return static_cast<std::size_t>(side_cells) * side_cells; }
};

class DistanceField {
 public:
  // Distances are exact up to `reach_m`, which is at most kReachMax cells, and `reach_m` beyond.
  DistanceField(std::span<const Cell> cells, const SquareGrid& grid, double reach_m);

  static constexpr int kReachMax = 12;  // In cells.
  static constexpr int kUnits = 20;

  struct Distance {
    double distance_m = 0;  // Bilinear interpolation of the distances of the cells.
    Eigen::Vector2d gradient = Eigen::Vector2d::Zero();
    bool is_known = false;  // False if the map knows nothing about the place.
  };
  Distance At(const Eigen::Vector2d& point_m) const;

  const SquareGrid& grid() const { return grid_; }
  // The distance of a cell in units of a cell / kUnits, at most kUnits * kReachMax.
  std::uint8_t UnitsAt(std::size_t index) const { return units_[index]; }
  bool IsKnown(std::size_t index) const { return known_[index]; }

  std::size_t bytes() const { return units_.capacity() + known_.capacity() / 8; }

 private:
  const SquareGrid grid_;
  const double reach_m_;
  std::vector<std::uint8_t> units_;
  std::vector<bool> known_;
};

}  // namespace moondb
