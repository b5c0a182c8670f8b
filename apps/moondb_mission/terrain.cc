#include "apps/moondb_mission/terrain.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace moondb {

namespace {

constexpr double kRockHeightOverDiameter = 0.5;
constexpr double kEquilibriumCratersPerM2 = 0.0794;  // Craters of at least 1 m diameter per m^2: 10^-1.1.
constexpr double kCraterDepthLeast = 0.02;
constexpr double kCraterDepthSpan = 0.16;
constexpr double kRimOverDepth = 0.2;
constexpr double kCraterReach = 2;  // Distance from the crater's centre to the end of the rim's apron, in crater radii.
constexpr int kSlopeCells = 3;      // Slopes are measured over 0.3 m, about a wheel base.
constexpr double kBaseHeight_m = 1.5;
constexpr int kSizeClasses = 512;
constexpr int kSwells = 5;

double RockDecay(double share) { return 1.79 + 0.152 / share; }

// Cumulative size distribution of rocks. Entries are in ascending order of diameter.
struct SizeLadder {
  std::vector<double> diameter_m;
  std::vector<double> per_m2;  // Number of rocks smaller than diameter_m[i] in each m^2.
};

SizeLadder MakeLadder(const TerrainOptions& options, double least_m) {
  const double share = options.rock_area_share;
  const double decay = RockDecay(share);
  const double ratio = std::pow(options.rock_diameter_max_m / least_m, 1.0 / kSizeClasses);
  SizeLadder ladder{{least_m}, {0}};
  for (int i = 0; i < kSizeClasses; ++i) {
    const double low = ladder.diameter_m.back();
    const double high = low * ratio;
    const double area_share = share * (std::exp(-decay * low) - std::exp(-decay * high));
    const double rock_area = std::numbers::pi / 4 * low * high;  // Area of a rock of the mean diameter of the class.
    ladder.diameter_m.push_back(high);
    ladder.per_m2.push_back(ladder.per_m2.back() + area_share / rock_area);
  }
  return ladder;
}

double DrawDiameter(const SizeLadder& ladder, Random& random) {
  const double drawn = random.Uniform() * ladder.per_m2.back();
  const auto rung = std::upper_bound(ladder.per_m2.begin(), ladder.per_m2.end(), drawn);
  const std::size_t above = std::clamp<std::size_t>(rung - ladder.per_m2.begin(), 1, ladder.per_m2.size() - 1);
  const double width = ladder.per_m2[above] - ladder.per_m2[above - 1];
  const double part = width > 0 ? (drawn - ladder.per_m2[above - 1]) / width : 0;
  return ladder.diameter_m[above - 1] + part * (ladder.diameter_m[above] - ladder.diameter_m[above - 1]);
}

// Returns the crater's height relative to the plain at a distance from its centre. The profile has a bowl, a rim, and
// an apron whose height decreases with the cube of the distance.
double CraterProfile(const Crater& crater, double distance_m) {
  const double radius_m = crater.diameter_m / 2;
  const double rim_m = kRimOverDepth * crater.depth_m;
  const double ratio = distance_m / radius_m;
  if (ratio < 1) return rim_m - crater.depth_m * (1 - ratio * ratio);
  // Subtract the apron's height at its end, so that the profile ends at zero without a step.
  const double end = 1 / (kCraterReach * kCraterReach * kCraterReach);
  return rim_m * (1 / (ratio * ratio * ratio) - end) / (1 - end);
}

Eigen::Vector2d DrawPlace(double half_m, Random& random) {
  const double x = random.Uniform(-half_m, half_m);
  return {x, random.Uniform(-half_m, half_m)};
}

}  // namespace

double RocksPerSquareMetre(const TerrainOptions& options, double diameter_m) {
  return MakeLadder(options, diameter_m).per_m2.back();
}

Terrain::Terrain(const TerrainOptions& options)
    : options_(options),
      half_m_(options.side_m / 2 + options.margin_m),
      side_cells_(static_cast<int>(std::lround(2 * half_m_ / kTerrainCell_m))),
      ground_m_(static_cast<std::size_t>(side_cells_) * side_cells_, 0.0f),
      is_hazard_(ground_m_.size(), 0) {}

Terrain Terrain::Make(const TerrainOptions& options, Random& random) {
  Terrain terrain(options);
  terrain.AddSwells(random);
  terrain.DrawCraters(random);
  terrain.MarkSlopes();
  terrain.surface_m_ = terrain.ground_m_;
  terrain.DrawRocks(random);
  terrain.AddBase();
  return terrain;
}

std::size_t Terrain::OffsetOf(const Eigen::Vector2d& point_m) const {
  const auto cell_of = [this](double value_m) {
    return std::clamp(static_cast<int>(std::floor((value_m + half_m_) / kTerrainCell_m)), 0, side_cells_ - 1);
  };
  return static_cast<std::size_t>(cell_of(point_m.y())) * side_cells_ + cell_of(point_m.x());
}

template <typename Visit>
void Terrain::ForEachCellNear(const Eigen::Vector2d& center_m, double radius_m, Visit visit) {
  const auto cell_of = [this](double value_m) {
    return static_cast<int>(std::floor((value_m + half_m_) / kTerrainCell_m));
  };
  const int left = std::max(0, cell_of(center_m.x() - radius_m));
  const int right = std::min(side_cells_ - 1, cell_of(center_m.x() + radius_m));
  const int bottom = std::max(0, cell_of(center_m.y() - radius_m));
  const int top = std::min(side_cells_ - 1, cell_of(center_m.y() + radius_m));
  for (int row = bottom; row <= top; ++row) {
    for (int column = left; column <= right; ++column) {
      const Eigen::Vector2d point((column + 0.5) * kTerrainCell_m - half_m_, (row + 0.5) * kTerrainCell_m - half_m_);
      const double distance_m = (point - center_m).norm();
      if (distance_m <= radius_m) visit(static_cast<std::size_t>(row) * side_cells_ + column, distance_m);
    }
  }
}

void Terrain::AddSwells(Random& random) {
  for (int i = 0; i < kSwells; ++i) {
    const double wavelength_m = random.Uniform(15, 45);
    const double direction = random.Uniform(0, 2 * std::numbers::pi);
    const double phase = random.Uniform(0, 2 * std::numbers::pi);
    const double height_m = random.Uniform(0.02, 0.005 * wavelength_m);
    const double along_x = std::cos(direction) * 2 * std::numbers::pi / wavelength_m * kTerrainCell_m;
    const double along_y = std::sin(direction) * 2 * std::numbers::pi / wavelength_m * kTerrainCell_m;
    // Computes sin(x + y) from the sines and cosines of x and y: two values per column and per row instead of one per
    // cell.
    std::vector<float> sine(side_cells_);
    std::vector<float> cosine(side_cells_);
    for (int column = 0; column < side_cells_; ++column) {
      sine[column] = static_cast<float>(std::sin(along_x * column + phase));
      cosine[column] = static_cast<float>(std::cos(along_x * column + phase));
    }
    for (int row = 0; row < side_cells_; ++row) {
      const float row_cosine = static_cast<float>(height_m * std::cos(along_y * row));
      const float row_sine = static_cast<float>(height_m * std::sin(along_y * row));
      float* heights = &ground_m_[static_cast<std::size_t>(row) * side_cells_];
      for (int column = 0; column < side_cells_; ++column) {
        heights[column] += sine[column] * row_cosine + cosine[column] * row_sine;
      }
    }
  }
}

bool Terrain::IsOnLandingGround(const Eigen::Vector2d& center_m, double radius_m) const {
  return (center_m - options_.base_m).norm() < options_.landing_radius_m + radius_m;
}

void Terrain::DrawCraters(Random& random) {
  const double least_m = options_.crater_diameter_min_m;
  const double most_m = options_.crater_diameter_max_m;
  // N(>D), the number of craters larger than D, is proportional to D^-2. Inverting the distribution gives a random D of
  // Dmin / sqrt(1 - u (1 - (Dmin / Dmax)^2)) for a uniform u.
  const double span = 1 - (least_m * least_m) / (most_m * most_m);
  const double per_m2 = options_.crater_share * kEquilibriumCratersPerM2 / (least_m * least_m) * span;
  const int count = random.Poisson(per_m2 * 4 * half_m_ * half_m_);
  for (int i = 0; i < count; ++i) {
    Crater crater;
    crater.center_m = DrawPlace(half_m_, random);
    crater.diameter_m = least_m / std::sqrt(1 - random.Uniform() * span);
    const double freshness = random.Uniform();
    crater.depth_m = crater.diameter_m * (kCraterDepthLeast + kCraterDepthSpan * std::pow(freshness, 3));
    if (!IsOnLandingGround(crater.center_m, crater.diameter_m / 2)) craters_.push_back(crater);
  }
  for (const Crater& crater : craters_) AddCrater(crater);
}

void Terrain::AddCrater(const Crater& crater) {
  ForEachCellNear(crater.center_m, kCraterReach * crater.diameter_m / 2, [&](std::size_t offset, double distance_m) {
    ground_m_[offset] += static_cast<float>(CraterProfile(crater, distance_m));
  });
}

void Terrain::MarkSlopes() {
  const double steepest = std::tan(options_.hazard_slope_rad) * 2 * kSlopeCells * kTerrainCell_m;
  for (int row = kSlopeCells; row + kSlopeCells < side_cells_; ++row) {
    for (int column = kSlopeCells; column + kSlopeCells < side_cells_; ++column) {
      const std::size_t at = static_cast<std::size_t>(row) * side_cells_ + column;
      const std::size_t rows = static_cast<std::size_t>(kSlopeCells) * side_cells_;
      const double along_x = ground_m_[at + kSlopeCells] - ground_m_[at - kSlopeCells];
      const double along_y = ground_m_[at + rows] - ground_m_[at - rows];
      if (along_x * along_x + along_y * along_y >= steepest * steepest) is_hazard_[at] = 1;
    }
  }
}

void Terrain::DrawRocks(Random& random) {
  const SizeLadder ladder = MakeLadder(options_, options_.rock_diameter_min_m);
  const int count = random.Poisson(ladder.per_m2.back() * 4 * half_m_ * half_m_);
  for (int i = 0; i < count; ++i) {
    Rock rock;
    rock.center_m = DrawPlace(half_m_, random);
    rock.diameter_m = DrawDiameter(ladder, random);
    rock.height_m = kRockHeightOverDiameter * rock.diameter_m;
    if (!IsOnLandingGround(rock.center_m, rock.diameter_m / 2)) rocks_.push_back(rock);
  }
  for (const Rock& rock : rocks_) AddRock(rock);
}

void Terrain::AddRock(const Rock& rock) {
  const double radius_m = rock.diameter_m / 2;
  const float base_m = static_cast<float>(GroundM(rock.center_m));
  const bool is_hazard = rock.height_m >= options_.hazard_height_m;
  ForEachCellNear(rock.center_m, radius_m, [&](std::size_t offset, double distance_m) {
    const double dome = std::sqrt(std::max(0.0, 1 - distance_m * distance_m / (radius_m * radius_m)));
    surface_m_[offset] = std::max(surface_m_[offset], base_m + static_cast<float>(rock.height_m * dome));
    if (is_hazard) is_hazard_[offset] = 1;
  });
}

void Terrain::AddBase() {
  const float top_m = static_cast<float>(GroundM(options_.base_m) + kBaseHeight_m);
  ForEachCellNear(options_.base_m, options_.base_radius_m, [&](std::size_t offset, double) {
    surface_m_[offset] = top_m;
    is_hazard_[offset] = 1;
  });
}

MergedMap Terrain::HazardMap() const {
  const int side = static_cast<int>(std::lround(options_.side_m / kTerrainCell_m));
  const int skip = (side_cells_ - side) / 2;
  MergedMap map{Grid(side, side, Cell::kFree), static_cast<std::uint32_t>(std::lround(kTerrainCell_m * 1e6)), -side / 2,
                -side / 2};
  for (int row = 0; row < side; ++row) {
    for (int column = 0; column < side; ++column) {
      if (is_hazard_[static_cast<std::size_t>(row + skip) * side_cells_ + column + skip] != 0) {
        map.grid.At(column, row) = Cell::kHazard;
      }
    }
  }
  return map;
}

}  // namespace moondb
