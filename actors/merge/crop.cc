#include "actors/merge/crop.h"

#include <algorithm>
#include <tuple>

namespace moondb {
namespace {

struct Point {
  std::int64_t x = 0;
  std::int64_t y = 0;
};

// Requires: the list is not empty. Returns the lower of two middle values.
std::int64_t MedianOf(std::vector<std::int64_t> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>((values.size() - 1) / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Point MedianOf(const std::vector<Point>& points) {
  std::vector<std::int64_t> xs;
  std::vector<std::int64_t> ys;
  for (const Point& point : points) {
    xs.push_back(point.x);
    ys.push_back(point.y);
  }
  return {MedianOf(std::move(xs)), MedianOf(std::move(ys))};
}

Point FindCentre(const std::vector<CropItem>& items) {
  std::map<AgentId, std::vector<Point>> origins;
  for (const CropItem& item : items) {
    origins[item.origin].push_back({item.box.first_x + (item.box.last_x - item.box.first_x) / 2,
                                    item.box.first_y + (item.box.last_y - item.box.first_y) / 2});
  }
  std::vector<Point> centres;
  for (const auto& [origin, points] : origins) centres.push_back(MedianOf(points));
  return MedianOf(centres);
}

std::int64_t DistanceOf(const CellBox& box, const Point& centre) {
  return std::max({centre.x - box.first_x, box.last_x - centre.x, centre.y - box.first_y, box.last_y - centre.y});
}

bool Fits(const CellBox& box, std::int64_t side_cells_max, std::int64_t area_cells_max) {
  return box.width() <= side_cells_max && box.height() <= side_cells_max &&
         (box.is_empty() || box.width() <= area_cells_max / box.height());
}

}  // namespace

Crop CropToFit(std::vector<CropItem> items, std::int64_t side_cells_max, std::int64_t area_cells_max) {
  std::erase_if(items, [](const CropItem& item) { return item.box.is_empty(); });
  Crop crop;
  for (const CropItem& item : items) crop.box.Add(item.box);
  if (Fits(crop.box, side_cells_max, area_cells_max)) return crop;
  const Point centre = FindCentre(items);
  const auto order = [&centre](const CropItem& item) {
    return std::tuple(DistanceOf(item.box, centre), item.origin, item.box.first_x, item.box.first_y, item.box.last_x,
                      item.box.last_y);
  };
  std::sort(items.begin(), items.end(), [&](const CropItem& a, const CropItem& b) { return order(a) < order(b); });
  crop.box = {};
  bool is_full = false;
  for (const CropItem& item : items) {
    CellBox box = crop.box;
    box.Add(item.box);
    const bool fits_alone = Fits(item.box, side_cells_max, area_cells_max);
    is_full = is_full || (fits_alone && !Fits(box, side_cells_max, area_cells_max));
    if (fits_alone && !is_full) {
      crop.box = box;
      continue;
    }
    LeftOutOfCrop& of_origin = crop.left_out[item.origin];
    if (of_origin.count++ == 0) of_origin.distance_cells = DistanceOf(item.box, centre);
  }
  return crop;
}

}  // namespace moondb
