// Terrain: a piece of the Moon with craters and rocks, and what of it a small rover cannot drive over.
//
// Rocks follow Golombek and Rapp (JGR 102, 1997): rocks of at least the diameter D cover the share
//   F(D) = k exp(-q D),  q = 1.79 + 0.152 / k,
// of the ground, D in metres; k is the share that all rocks cover. The number per area follows from dF = -(pi/4) D^2
// dN. They are half as high as wide. Craters follow the lunar equilibrium distribution of Trask (1966): N(>D) = 10^-1.1
// D^-2 per square metre. Most are worn down: their depth over their diameter lies between 0.02 and 0.18, few near the
// end of fresh ones. A cell is a hazard on a rock at least `hazard_height_m` high, on a slope of at least
// `hazard_slope_rad`, and on the lander that is the base station.
//
// Coordinates are the frame `map`; the explored square lies about the origin. Immutable once made.
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
  double side_m = 40;             // Of the square that rovers explore; 15 to 120.
  double margin_m = 12;           // Terrain beyond it, which cameras see.
  double rock_area_share = 0.03;  // k; 0.005 (a plain) to 0.1 (a blocky crater's rim).
  double rock_diameter_min_m = 0.1;
  double rock_diameter_max_m = 2.5;
  double crater_share = 1;  // Of the equilibrium number; 0 to 2.
  double crater_diameter_min_m = 1;
  double crater_diameter_max_m = 15;
  double hazard_height_m = 0.10;                     // What a small rover's wheels cannot climb.
  double hazard_slope_rad = 0.35;                    // 20 degrees.
  Eigen::Vector2d base_m = Eigen::Vector2d::Zero();  // The lander stands here,
  double base_radius_m = 0.8;                        // on a disc of this size,
  double landing_radius_m = 5;                       // amid ground without rocks and craters.
};

// Expected rocks per square metre of at least this diameter and at most the options' largest.
double RocksPerSquareMetre(const TerrainOptions& options, double diameter_m);

class Terrain {
 public:
  static Terrain Make(const TerrainOptions& options, Random& random);

  const TerrainOptions& options() const { return options_; }
  const std::vector<Rock>& rocks() const { return rocks_; }
  const std::vector<Crater>& craters() const { return craters_; }

  // Heights in metres, of the ground and of what stands on it. Outside the terrain that of its edge.
  double GroundM(const Eigen::Vector2d& point_m) const { return ground_m_[OffsetOf(point_m)]; }
  double SurfaceM(const Eigen::Vector2d& point_m) const { return surface_m_[OffsetOf(point_m)]; }
  bool IsHazard(const Eigen::Vector2d& point_m) const { return is_hazard_[OffsetOf(point_m)] != 0; }

  // The explored square, every cell known, with cells of kTerrainCell_m.
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
  // Calls visit(offset, distance from center) for the cells within a radius.
  template <typename Visit>
  void ForEachCellNear(const Eigen::Vector2d& center_m, double radius_m, Visit visit);

  TerrainOptions options_;
  double half_m_;  // Of the whole terrain's side.
  int side_cells_;
  std::vector<float> ground_m_;
  std::vector<float> surface_m_;
  std::vector<char> is_hazard_;
  std::vector<Rock> rocks_;
  std::vector<Crater> craters_;
};

}  // namespace moondb
