#include "bench/opencv_merger.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace moondb {
namespace {

struct Layer {
  std::uint32_t resolution_um = 0;  // 0: a footprint.
  std::int64_t stamp_ns = 0;
  PlacedRectangle placed;
  cv::Mat cells;
};

cv::Mat Unpack(const PackedBlock& packed) {
  cv::Mat cells(packed.block().height, packed.block().width, CV_8UC1);
  for (std::int32_t row = 0; row < cells.rows; ++row) {
    for (std::int32_t column = 0; column < cells.cols; ++column) {
      cells.at<std::uint8_t>(row, column) = static_cast<std::uint8_t>(packed.At(column, row));
    }
  }
  return cells;
}

class WarpMerger final : public OpencvMerger {
 public:
  WarpMerger(std::span<const PlacedMap> maps, std::span<const Footprint> footprints, const MergeGrid& grid) {
    cv::setNumThreads(1);
    for (const PlacedMap& map : maps) {
      const std::unique_ptr<PlacedThing> thing = *PlaceMap(map, grid);
      for (const PlacedBlock& block : thing->blocks) {
        layers_.push_back({block.resolution_um, block.stamp_ns, block.rectangle, Unpack(*block.cells)});
      }
    }
    std::stable_sort(layers_.begin(), layers_.end(), [](const Layer& a, const Layer& b) {
      return a.resolution_um != b.resolution_um ? a.resolution_um > b.resolution_um : a.stamp_ns < b.stamp_ns;
    });
    for (const Footprint& footprint : footprints) {
      const std::unique_ptr<PlacedThing> thing = *PlaceFootprint(footprint, grid);
      for (const PlacedBlock& block : thing->blocks) {
        const int width = static_cast<int>(block.rectangle.width_q >> kFractionBits);
        const int height = static_cast<int>(block.rectangle.height_q >> kFractionBits);
        layers_.push_back({0, 0, block.rectangle, cv::Mat(height, width, CV_8UC1, cv::Scalar(1))});
      }
    }
  }

  void Merge(const CellBox& extent) override {
    grid_ = cv::Mat::zeros(static_cast<int>(extent.height()), static_cast<int>(extent.width()), CV_8UC1);
    cv::Mat warped;
    for (const Layer& layer : layers_) {
      const PlacedRectangle& p = layer.placed;
      const cv::Rect box(static_cast<int>(p.box.first_x - extent.first_x),
                         static_cast<int>(p.box.first_y - extent.first_y), static_cast<int>(p.box.width()),
                         static_cast<int>(p.box.height()));
      // From the box's cells to the layer's; OpenCV counts from the centres of cells.
      const double unit = 1.0 / (1 << kFractionBits);
      const double c = p.step_cos * unit;
      const double s = p.step_sin * unit;
      const auto i = static_cast<double>(p.box.first_x - p.anchor_x);
      const auto j = static_cast<double>(p.box.first_y - p.anchor_y);
      const cv::Matx23d layer_from_box(c, s, p.u0 * unit + i * c + j * s - 0.5, -s, c,
                                       p.v0 * unit - i * s + j * c - 0.5);
      cv::warpAffine(layer.cells, warped, layer_from_box, box.size(), cv::INTER_NEAREST | cv::WARP_INVERSE_MAP,
                     cv::BORDER_CONSTANT, cv::Scalar(0));
      warped.copyTo(grid_(box), warped);
    }
  }

  std::vector<Cell> cells() const override {
    std::vector<Cell> cells;
    for (int row = 0; row < grid_.rows; ++row) {
      for (int column = 0; column < grid_.cols; ++column) {
        cells.push_back(static_cast<Cell>(grid_.at<std::uint8_t>(row, column)));
      }
    }
    return cells;
  }

 private:
  std::vector<Layer> layers_;
  cv::Mat grid_;
};

}  // namespace

std::unique_ptr<OpencvMerger> MakeOpencvMerger(std::span<const PlacedMap> maps, std::span<const Footprint> footprints,
                                               const MergeGrid& grid) {
  return std::make_unique<WarpMerger>(maps, footprints, grid);
}

}  // namespace moondb
