#include "bench/opencv_merger.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "bench/painted_layers.h"

namespace moondb {
namespace {

struct Layer {
  PlacedRectangle placed;
  cv::Mat cells;
};

class WarpMerger final : public OpencvMerger {
 public:
  WarpMerger(std::span<const PlacedMap> maps, std::span<const Footprint> footprints, const MergeGrid& grid) {
    cv::setNumThreads(1);
    for (const PaintedLayer& layer : LayersToPaint(maps, footprints, grid)) {
      cv::Mat cells(layer.height, layer.width, CV_8UC1, cv::Scalar(1));  // A footprint has only free cells.
      if (!layer.cells.empty())
        std::copy_n(reinterpret_cast<const std::uint8_t*>(layer.cells.data()), layer.cells.size(), cells.data);
      layers_.push_back({layer.placed, cells});
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
      // Transform from cells of the box to cells of the layer. In OpenCV, coordinate 0 is the centre of the first cell.
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
