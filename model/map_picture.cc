#include "model/map_picture.h"

#include <algorithm>
#include <cmath>

#include "model/picture_font.h"

namespace moondb {

namespace {

constexpr std::array<Color, 3> kCellColors = {{{72, 74, 80}, {232, 230, 222}, {139, 16, 20}}};
constexpr const Color& kUnknownColor = kCellColors[0];
constexpr Color kPaperColor = {250, 250, 248};
constexpr Color kGroundColor = {32, 33, 36};
constexpr Color kInkColor = {236, 236, 236};
constexpr Color kScaleColor = {40, 40, 40};
constexpr Color kBeforeColor = {140, 140, 140};
constexpr int kPixelsPerCellMax = 16;
constexpr int kFontScale = 2;
constexpr int kBarMargin = 6;
constexpr int kBarHeight = kGlyphHeight * kFontScale + 2 * kBarMargin;
constexpr int kGap = 8;
constexpr int kPlotMargin = 30;
constexpr int kPlotHeightMin = 200;
constexpr int kPlotHeightMax = 1800;

void Put(Image& image, int column, int row, const Color& color) {
  if (column < 0 || row < 0 || column >= image.width || row >= image.height) return;
  std::copy(color.begin(), color.end(), image.At(column, row));
}

Image Blank(int width, int height, const Color& color) {
  Image image(width, height, 3);
  for (int row = 0; row < height; ++row) {
    for (int column = 0; column < width; ++column) Put(image, column, row, color);
  }
  return image;
}

void PutDot(Image& image, const Eigen::Vector2d& at, int radius, const Color& color) {
  const int column = static_cast<int>(std::floor(at.x()));
  const int row = static_cast<int>(std::floor(at.y()));
  for (int y = -radius; y <= radius; ++y) {
    for (int x = -radius; x <= radius; ++x) {
      if (x * x + y * y <= radius * radius + radius) Put(image, column + x, row + y, color);
    }
  }
}

bool IsNear(const Image& image, const Eigen::Vector2d& at) {
  return at.x() > -image.width && at.x() < 2.0 * image.width && at.y() > -image.height && at.y() < 2.0 * image.height;
}

// Draws a line as dots half a pixel apart. Lines with an end far outside the picture are skipped, because an outlier
// pose could cost a billion dots.
void DrawLine(Image& image, const Eigen::Vector2d& from, const Eigen::Vector2d& to, int radius, const Color& color) {
  if (!IsNear(image, from) || !IsNear(image, to)) return;
  const int steps = 1 + static_cast<int>((to - from).norm() * 2);
  for (int step = 0; step <= steps; ++step) {
    PutDot(image, from + (to - from) * (static_cast<double>(step) / steps), radius, color);
  }
}

void DrawText(Image& image, int left, int top, std::string_view text, const Color& color) {
  for (const char character : text) {
    const Glyph glyph = GlyphOf(character);
    for (int y = 0; y < kGlyphHeight * kFontScale; ++y) {
      for (int x = 0; x < kGlyphWidth * kFontScale; ++x) {
        const bool is_set = (glyph[y / kFontScale] >> (kGlyphWidth - 1 - x / kFontScale)) & 1;
        if (is_set) Put(image, left + x, top + y, color);
      }
    }
    left += (kGlyphWidth + 1) * kFontScale;
  }
}

void Paste(const Image& from, int left, int top, Image& to) {
  for (int row = 0; row < from.height; ++row) {
    for (int column = 0; column < from.width; ++column) {
      const std::uint8_t* pixel = from.At(column, row);
      const Color color = from.channels < 3 ? Color{*pixel, *pixel, *pixel} : Color{pixel[0], pixel[1], pixel[2]};
      Put(to, left + column, top + row, color);
    }
  }
}

Image WithCaption(Image image, const std::string& caption) {
  if (caption.empty()) return image;
  Image result = Blank(image.width, image.height + kBarHeight, kGroundColor);
  DrawText(result, kBarMargin, kBarMargin, caption, kInkColor);
  Paste(image, 0, kBarHeight, result);
  return result;
}

const Color& ColorOf(Cell cell) { return CellColors()[static_cast<std::size_t>(cell)]; }

// Converts positions in the frame `map` to pixels. Row 0 is at the top.
struct View {
  double left_m = 0;
  double top_m = 0;
  double pixels_per_m = 1;
  Eigen::Vector2d operator()(const Eigen::Vector2d& point_m) const {
    return {(point_m.x() - left_m) * pixels_per_m, (top_m - point_m.y()) * pixels_per_m};
  }
};

void DrawTrack(Image& image, const View& view, const Track& track, int radius, const Color& color) {
  for (std::size_t i = 1; i < track.points_m.size(); ++i) {
    DrawLine(image, view(track.points_m[i - 1]), view(track.points_m[i]), radius, color);
  }
}

struct Extent {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e300);
  Eigen::Vector2d high = Eigen::Vector2d::Constant(-1e300);
  void Add(const std::vector<Track>& tracks) {
    for (const Track& track : tracks) {
      for (const Eigen::Vector2d& point : track.points_m) {
        low = low.cwiseMin(point);
        high = high.cwiseMax(point);
      }
    }
  }
  bool is_empty() const { return low.x() > high.x(); }
};

// Draws a scale bar of 1, 2 or 5 times a power of ten metres, about a fifth of the picture's width.
void DrawScale(Image& image, double pixels_per_m) {
  const double wanted_m = image.width / 5.0 / pixels_per_m;
  double length_m = std::pow(10, std::floor(std::log10(wanted_m)));
  for (const double factor : {5.0, 2.0}) {
    if (length_m * factor <= wanted_m) {
      length_m *= factor;
      break;
    }
  }
  const double row = image.height - 12;
  DrawLine(image, {12, row}, {12 + length_m * pixels_per_m, row}, 1, kScaleColor);
  std::string text = std::to_string(length_m);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  DrawText(image, 12, image.height - 32, text + " m", kScaleColor);
}

}  // namespace

const std::array<Color, 3>& CellColors() { return kCellColors; }

Image CellPicture(const MergedMap& map) {
  Image image(map.grid.width, map.grid.height, 1);
  for (int row = 0; row < image.height; ++row) {
    for (int column = 0; column < image.width; ++column) {
      *image.At(column, row) = static_cast<std::uint8_t>(map.grid.At(column, image.height - 1 - row));
    }
  }
  return image;
}

Color AgentColor(std::size_t place) {
  // People with any colour vision can distinguish these colours, on light and on dark backgrounds.
  static constexpr Color kColors[] = {{0, 114, 178}, {213, 94, 0},   {0, 158, 115},  {204, 121, 167},
                                      {230, 159, 0}, {86, 180, 233}, {120, 80, 200}, {150, 130, 20}};
  return kColors[place % std::size(kColors)];
}

std::vector<Track> TracksOf(const std::map<NodeKey, Pose>& poses, const std::vector<AgentId>& agents) {
  std::vector<Track> tracks;
  for (std::size_t place = 0; place < agents.size(); ++place) {
    Track track{AgentColor(place), {}};
    for (auto it = poses.lower_bound(NodeKey{agents[place], 0}); it != poses.end(); ++it) {
      if (it->first.agent != agents[place]) break;
      track.points_m.push_back(it->second.position_m.head<2>());
    }
    tracks.push_back(std::move(track));
  }
  return tracks;
}

Image DrawMap(const MergedMap& whole, const std::vector<Track>& tracks, const MapPictureOptions& options) {
  const MergedMap map = options.is_cropped ? CroppedToKnown(whole, kCropMarginCells) : whole;
  const Grid& grid = map.grid;
  const int side = std::max({grid.width, grid.height, 1});
  // Downsample a map that is larger than the largest picture: one pixel per `stride` cells.
  const int stride = (side + kImageSideMax / 4 - 1) / (kImageSideMax / 4);
  const int scale = std::clamp(std::min(options.pixels_per_cell, kImageSideMax / 4 / side), 1, kPixelsPerCellMax);
  const int columns = std::max(1, grid.width / stride);
  const int rows = std::max(1, grid.height / stride);
  Image image = Blank(columns * scale, rows * scale, kUnknownColor);
  for (int row = 0; row < image.height && grid.height > 0; ++row) {
    const int grid_row = std::max(0, grid.height - 1 - row / scale * stride);
    for (int column = 0; column < image.width && grid.width > 0; ++column) {
      Put(image, column, row, ColorOf(grid.At(column / scale * stride, grid_row)));
    }
  }
  const double resolution_m = map.resolution_um / 1e6;
  const View view{static_cast<double>(map.origin_cell_x) * resolution_m,
                  static_cast<double>(map.origin_cell_y + grid.height) * resolution_m, scale / (resolution_m * stride)};
  for (const Track& track : tracks) {
    if (map.resolution_um == 0 || track.points_m.empty()) continue;
    DrawTrack(image, view, track, 1, track.color);
    if (IsNear(image, view(track.points_m.front()))) PutDot(image, view(track.points_m.front()), 4, track.color);
  }
  return WithCaption(std::move(image), options.caption);
}

Image SideBySide(const Image& left, const Image& right) {
  Image image = Blank(left.width + kGap + right.width, std::max(left.height, right.height), kGroundColor);
  Paste(left, 0, 0, image);
  Paste(right, left.width + kGap, 0, image);
  return image;
}

Image DrawTrajectories(const std::vector<Track>& before, const std::vector<Track>& after,
                       const std::vector<Track>& truth, const TrajectoryPlotOptions& options) {
  Extent extent;
  for (const auto* tracks : {&before, &after, &truth}) extent.Add(*tracks);
  if (extent.is_empty()) extent = Extent{Eigen::Vector2d::Zero(), Eigen::Vector2d::Ones()};
  const Eigen::Vector2d size = (extent.high - extent.low).cwiseMax(1e-3);
  const int width = std::clamp(options.width_px, 200, 8192);
  double pixels_per_m = (width - 2 * kPlotMargin) / size.x();
  const double room = kPlotHeightMax - 2 * kPlotMargin;
  if (size.y() * pixels_per_m > room) pixels_per_m = room / size.y();
  const int height = std::max(kPlotHeightMin, static_cast<int>(size.y() * pixels_per_m) + 2 * kPlotMargin);
  Image image = Blank(width, height, kPaperColor);
  const View view{extent.low.x() - kPlotMargin / pixels_per_m, extent.high.y() + kPlotMargin / pixels_per_m,
                  pixels_per_m};
  for (const Track& track : truth) {
    Color pale;
    for (int i = 0; i < 3; ++i) pale[i] = static_cast<std::uint8_t>((track.color[i] + 2 * 255) / 3);
    DrawTrack(image, view, track, 4, pale);
  }
  for (const Track& track : before) DrawTrack(image, view, track, 0, kBeforeColor);
  for (const Track& track : after) DrawTrack(image, view, track, 1, track.color);
  DrawScale(image, pixels_per_m);
  return WithCaption(std::move(image), options.caption);
}

}  // namespace moondb
