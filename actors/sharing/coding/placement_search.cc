// FindPlacement: correlates the hazards of two maps, first on the coarsest layer for all yaws, then on finer layers
// around the best candidates.
#include <algorithm>
#include <array>

#include "actors/sharing/coding/placement.h"

namespace moondb {

namespace {

constexpr std::size_t kPointsMax = 128;      // Largest number of hazards that are sampled per layer.
constexpr std::size_t kPointsMin = 6;        // Fewer hazards do not determine a placement.
constexpr std::int32_t kReachCells = 6;      // Largest shift in cells of the coarsest layer, in each direction.
constexpr std::int32_t kCoarseTurnStep = 8;  // Yaw step of the coarse search: 8/1024 turn, which is 2.8 degrees.
constexpr std::size_t kCandidates = 3;
constexpr std::int8_t kOnHazard = 4;
constexpr std::int8_t kBesideHazard = 2;
constexpr std::int8_t kOnFree = -1;
constexpr std::uint8_t kHazardCell = 2;

// Centre of a hazard cell of the later map, relative to the middle of its layer, in half micrometres.
struct Point {
  std::int64_t x = 0;
  std::int64_t y = 0;
};

bool IsHazard(const CellPlane& cells, std::int32_t column, std::int32_t row) {
  return *cells.At(column, row) == kHazardCell;
}

// Returns true for a hazard that touches another hazard. A single hazard cell is mostly noise.
bool IsSupported(const CellPlane& cells, std::int32_t column, std::int32_t row) {
  if (!IsHazard(cells, column, row)) return false;
  int beside = -1;
  for (std::int32_t y = -1; y <= 1; ++y) {
    for (std::int32_t x = -1; x <= 1; ++x) beside += IsHazard(cells, column + x, row + y) ? 1 : 0;
  }
  return beside > 0;
}

// For each cell of an earlier layer, the score of a hazard of the later map that lies on this cell.
class Field {
 public:
  explicit Field(const CodedLayer& layer)
      : width_(layer.cells.width()),
        height_(layer.cells.height()),
        resolution_um_(layer.resolution_um),
        stride_(width_ + 2 * kReachCells),
        worth_(static_cast<std::size_t>(stride_) * static_cast<std::size_t>(height_ + 2 * kReachCells)) {
    const CellPlane& cells = layer.cells;
    for (std::int32_t row = 0; row < height_; ++row) {
      for (std::int32_t column = 0; column < width_; ++column) {
        *At(column, row) = *cells.At(column, row) == 0 ? 0 : kOnFree;
      }
    }
    for (std::int32_t row = 0; row < height_; ++row) {
      for (std::int32_t column = 0; column < width_; ++column) {
        if (IsSupported(cells, column, row)) Mark(column, row);
      }
    }
  }

  std::int64_t resolution_um() const { return resolution_um_; }
  std::int32_t stride() const { return stride_; }
  std::int8_t* At(std::int32_t column, std::int32_t row) {
    return worth_.data() + static_cast<std::ptrdiff_t>(row + kReachCells) * stride_ + column + kReachCells;
  }

  // Returns a pointer to the score of the cell at a point, or null outside of the layer. `x` and `y` are relative to
  // the layer's middle, in units of 1/2^kRotationBits of half a micrometre.
  const std::int8_t* Under(std::int64_t x, std::int64_t y) {
    const std::int64_t unit = 2 * resolution_um_;
    const std::int64_t column = ((x >> kRotationBits) + width_ * resolution_um_);
    const std::int64_t row = ((y >> kRotationBits) + height_ * resolution_um_);
    if (column < 0 || row < 0 || column >= width_ * unit || row >= height_ * unit) return nullptr;
    return At(static_cast<std::int32_t>(column / unit), static_cast<std::int32_t>(row / unit));
  }

 private:
  // Raises the scores of a hazard cell and of the cells around it. Never lowers a score.
  void Mark(std::int32_t column, std::int32_t row) {
    for (std::int32_t y = -1; y <= 1; ++y) {
      for (std::int32_t x = -1; x <= 1; ++x) {
        std::int8_t& worth = *At(column + x, row + y);
        worth = std::max(worth, x == 0 && y == 0 ? kOnHazard : kBesideHazard);
      }
    }
  }

  std::int32_t width_;
  std::int32_t height_;
  std::int64_t resolution_um_;
  std::int32_t stride_;
  std::vector<std::int8_t> worth_;
};

// Returns at most kPointsMax hazards that touch another hazard, sampled evenly.
std::vector<Point> PointsOf(const CodedLayer& layer) {
  std::vector<Point> points;
  const std::int64_t resolution = layer.resolution_um;
  for (std::int32_t row = 0; row < layer.cells.height(); ++row) {
    for (std::int32_t column = 0; column < layer.cells.width(); ++column) {
      if (!IsSupported(layer.cells, column, row)) continue;
      points.push_back(
          {(2 * column + 1 - layer.cells.width()) * resolution, (2 * row + 1 - layer.cells.height()) * resolution});
    }
  }
  if (points.size() <= kPointsMax) return points;
  std::vector<Point> some;
  for (std::size_t i = 0; i < kPointsMax; ++i) some.push_back(points[i * points.size() / kPointsMax]);
  return some;
}

struct Candidate {
  MapPlacement placement;
  std::int32_t score = 0;
};

// One layer of both maps: the scores of the earlier map, the hazards of the later map.
struct Level {
  Field field;
  std::vector<Point> points;
};

class Search {
 public:
  Search(const CodedLayers& earlier, const CodedLayers& later) : unit_um_(later.front().resolution_um) {
    for (std::size_t i = 0; i < std::min(earlier.size(), later.size()); ++i) {
      levels_.push_back({Field(earlier[i]), PointsOf(later[i])});
    }
  }

  std::optional<MapPlacement> Run() {
    std::vector<Candidate> candidates = Coarse();
    if (candidates.empty()) return std::nullopt;
    for (std::size_t i = levels_.size(); i-- > 0;) Refine(i, i + 1, 2, candidates);
    candidates.resize(1);
    Refine(0, levels_.size(), 1, candidates);
    if (candidates.front().score <= 0) return std::nullopt;
    return candidates.front().placement;
  }

 private:
  // Returns the best placements for the yaws with the highest scores, and the best one for yaw 0, since a rolling map
  // does not rotate.
  std::vector<Candidate> Coarse() {
    std::vector<Candidate> best;
    if (levels_.back().points.size() < kPointsMin) return best;
    for (std::int32_t yaw = 0; yaw < kTurn; yaw += kCoarseTurnStep) best.push_back(BestShift(yaw));
    const Candidate straight = best.front();
    std::stable_sort(best.begin(), best.end(), [](const auto& a, const auto& b) { return a.score > b.score; });
    best.resize(kCandidates);
    best.push_back(straight);
    return best;
  }

  Candidate BestShift(std::int32_t yaw) {
    Field& field = levels_.back().field;
    const Rotation rotation = RotationOf(yaw);
    std::array<const std::int8_t*, kPointsMax> under;
    std::size_t count = 0;
    for (const Point& point : levels_.back().points) {
      const std::int8_t* cell = field.Under(rotation.cosine * point.x - rotation.sine * point.y,
                                            rotation.sine * point.x + rotation.cosine * point.y);
      if (cell) under[count++] = cell;
    }
    Candidate best{{0, 0, yaw}, INT32_MIN};
    for (std::int32_t y = -kReachCells; y <= kReachCells; ++y) {
      for (std::int32_t x = -kReachCells; x <= kReachCells; ++x) {
        const std::ptrdiff_t shift = static_cast<std::ptrdiff_t>(y) * field.stride() + x;
        std::int32_t score = 0;
        for (std::size_t i = 0; i < count; ++i) score += under[i][shift];
        if (score > best.score) best = {{Units(x, field), Units(y, field), yaw}, score};
      }
    }
    return best;
  }

  std::int32_t Units(std::int32_t cells, const Field& field) const {
    const std::int64_t units = 2 * cells * field.resolution_um() / unit_um_;
    return static_cast<std::int32_t>(std::clamp<std::int64_t>(units, kLeast, kMost));
  }

  // Improves each candidate by hill climbing. Position steps are half a cell of level `first`; yaw steps are `turn`.
  // Sorts the candidates by score, best first.
  void Refine(std::size_t first, std::size_t end, std::int32_t turn, std::vector<Candidate>& candidates) {
    const std::int32_t step = std::max(1, Units(1, levels_[first].field) / 2);
    for (Candidate& candidate : candidates) {
      candidate.score = Score(first, end, candidate.placement);
      Climb(first, end, step, turn, candidate);
    }
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const auto& a, const auto& b) { return a.score > b.score; });
  }

  void Climb(std::size_t first, std::size_t end, std::int32_t step, std::int32_t turn, Candidate& candidate) {
    constexpr int kRoundsMax = 12;
    for (int round = 0; round < kRoundsMax; ++round) {
      const Candidate before = candidate;
      for (std::int32_t move = 0; move < 27; ++move) {
        const MapPlacement& from = before.placement;
        const MapPlacement to{std::clamp(from.x + (move % 3 - 1) * step, kLeast, kMost),
                              std::clamp(from.y + (move / 3 % 3 - 1) * step, kLeast, kMost),
                              (from.yaw + (move / 9 - 1) * turn) & (kTurn - 1)};
        const std::int32_t score = Score(first, end, to);
        if (score > candidate.score) candidate = {to, score};
      }
      if (candidate.placement == before.placement) return;
    }
  }

  std::int32_t Score(std::size_t first, std::size_t end, const MapPlacement& placement) {
    const Rotation rotation = RotationOf(placement.yaw);
    const std::int64_t x = (std::int64_t{placement.x} * unit_um_) << kRotationBits;
    const std::int64_t y = (std::int64_t{placement.y} * unit_um_) << kRotationBits;
    std::int32_t score = 0;
    for (std::size_t i = first; i < end; ++i) {
      for (const Point& point : levels_[i].points) {
        const std::int8_t* cell = levels_[i].field.Under(x + rotation.cosine * point.x - rotation.sine * point.y,
                                                         y + rotation.sine * point.x + rotation.cosine * point.y);
        if (cell) score += *cell;
      }
    }
    return score;
  }

  static constexpr std::int32_t kLeast = -(1 << (kPlacementBits - 1));
  static constexpr std::int32_t kMost = (1 << (kPlacementBits - 1)) - 1;

  std::int64_t unit_um_;
  std::vector<Level> levels_;
};

}  // namespace

std::optional<MapPlacement> FindPlacement(const CodedLayers& earlier, const CodedLayers& later) {
  if (earlier.empty() || later.empty()) return std::nullopt;
  return Search(earlier, later).Run();
}

}  // namespace moondb
