// Terrain: heights of a simulated area of the Moon with craters and rocks, and the cells that a small rover cannot
// cross.
//
// Rocks follow Golombek and Rapp (JGR 102, 1997). Rocks with a diameter of at least D metres cover the share
//     F(D) = k exp(-q D),  q = 1.79 + 0.152 / k,
// of the area; k is the share that all rocks cover. The number per area follows from dF = -(pi/4) D^2 dN. Rocks are
// half as high as wide.
//
// Craters follow the lunar equilibrium distribution of Trask (1966): N(>D) = 10^-1.1 D^-2 per square metre. Most are
// degraded: their ratio of depth to diameter is between 0.02 and 0.18, and few are close to 0.18, the ratio of fresh
// craters.
//
// A cell is a hazard on a rock at least `hazard_height_m` high, on a slope of at least `hazard_slope_rad`, and on the
// lander that is the base station.
//
// Coordinates are in the frame `map`. The explored square is centred on the origin. Immutable once made.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "apps/moondb_mission/random.h"
#include "model/grid.h"

namespace moondb {

inline constexpr double kTerrainCell_m = 0.05;

struct Rock {
  Eigen::Vector2d center_m = Eigen::Vector2d::Zero();
  double diameter_m = 0;
  double height_m = 0;
};

struct Crater {
  Eigen::Vector2d center_m = Eigen::Vector2d::Zero();
  double diameter_m = 0;
  double depth_m = 0;
};

struct TerrainOptions {
  double side_m = 40;             // Side of the square that rovers explore; 15 to 120.
  double margin_m = 12;           // Width of the terrain around the square, which only cameras see.
  double rock_area_share = 0.03;  // Share covered by rocks (k above): 0.005 (plain) to 0.1 (rim of a blocky crater).
  double rock_diameter_min_m = 0.1;
  double rock_diameter_max_m = 2.5;
  double crater_share = 1;  // Number of craters, relative to the equilibrium number; 0 to 2.
  double crater_diameter_min_m = 1;
  double crater_diameter_max_m = 15;
  double hazard_height_m = 0.10;                     // Rocks at least this high are hazards.
  double hazard_slope_rad = 0.35;                    // Slopes at least this steep are hazards; 20 degrees.
  Eigen::Vector2d base_m = Eigen::Vector2d::Zero();  // Position of the lander.
  double base_radius_m = 0.8;                        // Radius of the lander.
  double landing_radius_m = 5;                       // No rocks and craters within this radius of the lander.
};

// Returns the expected number of rocks per square metre with diameters from `diameter_m` to the options' largest
// diameter.
double RocksPerSquareMetre(const TerrainOptions& options, double diameter_m);

class Terrain {
 public:
  static Terrain Make(const TerrainOptions& options, Random& random);

  const TerrainOptions& options() const { return options_; }
  const std::vector<Rock>& rocks() const { return rocks_; }
  const std::vector<Crater>& craters() const { return craters_; }

  // Heights in metres. GroundM: the bare terrain. SurfaceM: with rocks and the lander. Points outside the terrain have
  // the height of the nearest edge.
  double GroundM(const Eigen::Vector2d& point_m) const { return ground_m_[OffsetOf(point_m)]; }
  double SurfaceM(const Eigen::Vector2d& point_m) const { return surface_m_[OffsetOf(point_m)]; }
  bool IsHazard(const Eigen::Vector2d& point_m) const { return is_hazard_[OffsetOf(point_m)] != 0; }

  // Returns the explored square as a map with cells of kTerrainCell_m. No cell is unknown.
  MergedMap HazardMap() const;

 private:
  explicit Terrain(const TerrainOptions& options);

  void DrawCraters(Random& random);
  void DrawRocks(Random& random);
  void AddSwells(Random& random);
  void AddCrater(const Crater& crater);
  void AddRock(const Rock& rock);
  void MarkSlopes();
  void AddBase();
  bool IsOnLandingGround(const Eigen::Vector2d& center_m, double radius_m) const;
  std::size_t OffsetOf(const Eigen::Vector2d& point_m) const;
  // Calls visit(offset, distance_m) for each cell whose centre is within `radius_m` of `center_m`.
  template <typename Visit>
  void ForEachCellNear(const Eigen::Vector2d& center_m, double radius_m, Visit visit);

  TerrainOptions options_;
  double half_m_;  // Half the side of the whole terrain.
  int side_cells_;
  std::vector<float> ground_m_;
  std::vector<float> surface_m_;
  std::vector<char> is_hazard_;
  std::vector<Rock> rocks_;
  std::vector<Crater> craters_;
};

}  // namespace moondb
