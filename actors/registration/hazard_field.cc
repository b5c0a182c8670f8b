#include "actors/registration/hazard_field.h"

#include <algorithm>
#include <cmath>

#include "model/grid.h"

namespace moondb {
namespace {

constexpr double kLikelihoodSigma_m = 0.08;

// Rectangle of field cells.
struct Span {
  int first_x, last_x, first_y, last_y;
};

bool IsUsed(const MapLayer& layer) { return layer.resolution_um <= HazardField::kCoarsestLayer_um; }

double ReachOf(const TraversabilityMap& map) {
  double reach_m = 0;
  for (const MapLayer& layer : map.layers) {
    if (!IsUsed(layer)) continue;
    const Eigen::Vector2d low = CornerOf(layer);
    const Eigen::Vector2d high = low + layer.resolution_m() * Eigen::Vector2d(layer.grid.width, layer.grid.height);
    reach_m = std::max({reach_m, -low.minCoeff(), high.maxCoeff()});
  }
  return std::min(reach_m, HazardField::kFieldSideMax_m / 2);
}

}  // namespace

std::vector<Eigen::Vector2d> SamplePoints(const std::vector<Eigen::Vector2d>& points_m, std::size_t count_max) {
  std::vector<Eigen::Vector2d> sample;
  const std::size_t count = std::min(points_m.size(), count_max);
  sample.reserve(count);
  for (std::size_t i = 0; i < count; ++i) sample.push_back(points_m[i * points_m.size() / count]);
  return sample;
}

HazardField::HazardField(const TraversabilityMap& map, std::span<const MaskedDisc> masked)
    : grid_{2 * static_cast<int>(std::ceil(ReachOf(map) / kCell_m)), kCell_m},
      distances_(Draw(map, masked), grid_, kDistanceMax_m) {
  FillLevels();
}

// Returns the cells of the field, and fills points_m_.
std::vector<Cell> HazardField::Draw(const TraversabilityMap& map, std::span<const MaskedDisc> masked) {
  const int side = grid_.side_cells;
  std::vector<Cell> cells(grid_.cell_count());
  std::vector<std::uint8_t> owners(cells.size());  // 1 + index of the layer that a cell was taken from.
  // Calls `take(column, row, center_m, value)` for each known cell of a layer that overlaps the field.
  const auto for_each_cell = [&](const MapLayer& layer, const auto& take) {
    const double resolution_m = layer.resolution_m();
    const Eigen::Vector2d corner_m = CornerOf(layer);
    const double reach_m = side / 2 * kCell_m;
    const auto first = [&](double corner, int size) {
      return std::clamp(static_cast<int>(std::floor((-reach_m - corner) / resolution_m)), 0, size);
    };
    const auto last = [&](double corner, int size) {
      return std::clamp(static_cast<int>(std::ceil((reach_m - corner) / resolution_m)), 0, size);
    };
    const int end_x = last(corner_m.x(), layer.grid.width);
    const int end_y = last(corner_m.y(), layer.grid.height);
    for (int y = first(corner_m.y(), layer.grid.height); y < end_y; ++y) {
      for (int x = first(corner_m.x(), layer.grid.width); x < end_x; ++x) {
        const Cell value = layer.grid.At(x, y);
        if (value == Cell::kUnknown) continue;
        take(Eigen::Vector2d(corner_m + resolution_m * Eigen::Vector2d(x + 0.5, y + 0.5)), value);
      }
    }
  };
  for (std::size_t i = map.layers.size(); i-- > 0;) {
    const MapLayer& layer = map.layers[i];
    if (!IsUsed(layer)) continue;
    const double half_m = std::max(layer.resolution_m(), kCell_m) / 2 * (1 - 1e-6);
    const std::uint8_t owner = static_cast<std::uint8_t>(i + 1);
    for_each_cell(layer, [&](const Eigen::Vector2d& center_m, Cell value) {
      const bool is_fine = layer.resolution_m() < kCell_m;
      const double reach_m = is_fine ? 0 : half_m;
      const Span span = {
          std::max(ToCell(center_m.x() - reach_m), 0), std::min(ToCell(center_m.x() + reach_m), side - 1),
          std::max(ToCell(center_m.y() - reach_m), 0), std::min(ToCell(center_m.y() + reach_m), side - 1)};
      for (int y = span.first_y; y <= span.last_y; ++y) {
        for (int x = span.first_x; x <= span.last_x; ++x) {
          const std::size_t at = grid_.IndexOf(x, y);
          const bool keeps_hazard = owners[at] == owner && cells[at] == Cell::kHazard;
          if (keeps_hazard) continue;
          owners[at] = owner;
          cells[at] = value;
        }
      }
    });
  }
  for (const MaskedDisc& disc : masked) {
    const double reach_m = disc.radius_m;
    for (int y = std::max(ToCell(disc.center_m.y() - reach_m), 0);
         y <= std::min(ToCell(disc.center_m.y() + reach_m), side - 1); ++y) {
      for (int x = std::max(ToCell(disc.center_m.x() - reach_m), 0);
           x <= std::min(ToCell(disc.center_m.x() + reach_m), side - 1); ++x) {
        const Eigen::Vector2d center_m(grid_.ToCenter_m(x), grid_.ToCenter_m(y));
        if ((center_m - disc.center_m).norm() <= reach_m) cells[grid_.IndexOf(x, y)] = Cell::kUnknown;
      }
    }
  }
  for (std::size_t i = 0; i < map.layers.size(); ++i) {
    const MapLayer& layer = map.layers[i];
    if (!IsUsed(layer)) continue;
    for_each_cell(layer, [&](const Eigen::Vector2d& center_m, Cell value) {
      const int x = ToCell(center_m.x());
      const int y = ToCell(center_m.y());
      if (value != Cell::kHazard || !grid_.IsInside(x, y)) return;
      const std::size_t at = grid_.IndexOf(x, y);
      if (owners[at] != i + 1 || cells[at] != Cell::kHazard) return;
      points_m_.push_back(center_m);
      if (layer.resolution_m() < kCell_m) owners[at] = 0;  // One point per field cell is enough.
    });
  }
  points_m_ = SamplePoints(points_m_, kPointsMax);
  return cells;
}

void HazardField::FillLevels() {
  std::array<std::uint8_t, 256> likelihoods;
  for (std::size_t i = 0; i < likelihoods.size(); ++i) {
    const double sigmas = static_cast<double>(i) * kCell_m / DistanceField::kUnits / kLikelihoodSigma_m;
    likelihoods[i] = static_cast<std::uint8_t>(std::lround(255 * std::exp(-sigmas * sigmas / 2)));
  }
  const int side = grid_.side_cells;
  const int stride = side + 2 * kPadding;
  levels_[0].assign(static_cast<std::size_t>(stride) * stride, kUnknownLikelihood);
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      const std::size_t at = grid_.IndexOf(x, y);
      const std::uint8_t likelihood = likelihoods[distances_.UnitsAt(at)];
      levels_[0][static_cast<std::size_t>(y + kPadding) * stride + x + kPadding] =
          distances_.IsKnown(at) ? likelihood : std::max(likelihood, kUnknownLikelihood);
    }
  }
  for (int level = 1; level < kLevels; ++level) {
    const int half = 1 << (level - 1);
    const std::vector<std::uint8_t>& finer = levels_[level - 1];
    std::vector<std::uint8_t>& coarser = levels_[level];
    coarser.resize(finer.size());
    for (int y = 0; y < stride; ++y) {
      const std::uint8_t* const low = &finer[static_cast<std::size_t>(y) * stride];
      const std::uint8_t* const high = &finer[static_cast<std::size_t>(std::min(y + half, stride - 1)) * stride];
      std::uint8_t* const out = &coarser[static_cast<std::size_t>(y) * stride];
      for (int x = 0; x + half < stride; ++x) {
        out[x] = std::max(std::max(low[x], low[x + half]), std::max(high[x], high[x + half]));
      }
      for (int x = stride - half; x < stride; ++x) out[x] = std::max({low[x], high[x], kUnknownLikelihood});
    }
  }
}

std::uint32_t HazardField::SumOfLikelihoods(int level, std::span<const FieldCell> cells, const FieldBox& box,
                                            int column, int row) const {
  const std::vector<std::uint8_t>& likelihoods = levels_[static_cast<std::size_t>(level)];
  const int stride = grid_.side_cells + 2 * kPadding;
  const int first_x = column + kPadding;
  const int first_y = row + kPadding;
  std::uint32_t sum = 0;
  if (box.first.column + first_x >= 0 && box.first.row + first_y >= 0 && box.last.column + first_x < stride &&
      box.last.row + first_y < stride) {
    const std::uint8_t* const from = likelihoods.data() + static_cast<std::ptrdiff_t>(first_y) * stride + first_x;
    for (const FieldCell& cell : cells) sum += from[static_cast<std::ptrdiff_t>(cell.row) * stride + cell.column];
    return sum;
  }
  for (const FieldCell& cell : cells) {
    const int x = cell.column + first_x;
    const int y = cell.row + first_y;
    const bool is_inside = x >= 0 && y >= 0 && x < stride && y < stride;
    sum += is_inside ? likelihoods[static_cast<std::size_t>(y) * stride + x] : kUnknownLikelihood;
  }
  return sum;
}

std::size_t HazardField::bytes() const {
  std::size_t bytes = points_m_.capacity() * sizeof(Eigen::Vector2d) + distances_.bytes();
  for (const auto& level : levels_) bytes += level.capacity();
  return bytes;
}

}  // namespace moondb
