#include "bench/merge_plot.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "model/map_picture.h"
#include "model/picture_font.h"

namespace moondb {
namespace {

constexpr int kWidth = 1000;
constexpr int kHeight = 640;
constexpr int kLeft = 90;
constexpr int kRight = 730;
constexpr int kTop = 50;
constexpr int kBottom = 570;
constexpr Color kInk = {40, 40, 40};
constexpr Color kPale = {225, 225, 225};

struct Line {
  std::string name;
  Color color;
  std::function<std::optional<double>(const MergeRun&)> value_ms;
};

std::vector<Line> Lines() {
  return {{"naive", {90, 90, 90}, [](const MergeRun& run) { return run.naive_ms; }},
          {"opencv warp and copy", {180, 120, 30}, [](const MergeRun& run) { return run.opencv_ms; }},
          {"paper's painter, gl", {150, 60, 150}, [](const MergeRun& run) { return run.painter_ms; }},
          {"moondb, gl", {200, 40, 40}, [](const MergeRun& run) { return run.gl_ms; }},
          {"moondb, cpu", {30, 90, 200}, [](const MergeRun& run) { return run.cpu_ms; }},
          {"one more map, gl", {240, 130, 130}, [](const MergeRun& run) { return run.incremental_gl_ms; }},
          {"one more map, cpu", {120, 170, 250}, [](const MergeRun& run) { return run.incremental_cpu_ms; }}};
}

void Put(Image& image, int x, int y, const Color& color) {
  if (x < 0 || y < 0 || x >= image.width || y >= image.height) return;
  std::copy(color.begin(), color.end(), image.At(x, y));
}

void DrawStroke(Image& image, double x0, double y0, double x1, double y1, const Color& color, int thickness) {
  const int steps = static_cast<int>(std::max(std::abs(x1 - x0), std::abs(y1 - y0))) + 1;
  for (int i = 0; i <= steps; ++i) {
    const double t = static_cast<double>(i) / steps;
    const int x = static_cast<int>(std::lround(x0 + t * (x1 - x0)));
    const int y = static_cast<int>(std::lround(y0 + t * (y1 - y0)));
    for (int dy = 0; dy < thickness; ++dy) {
      for (int dx = 0; dx < thickness; ++dx) Put(image, x + dx - thickness / 2, y + dy - thickness / 2, color);
    }
  }
}

void DrawText(Image& image, int x, int y, std::string_view text, const Color& color, int scale = 2) {
  for (const char character : text) {
    const Glyph glyph = GlyphOf(character);
    for (int row = 0; row < kGlyphHeight * scale; ++row) {
      for (int column = 0; column < kGlyphWidth * scale; ++column) {
        const bool is_ink =
            (glyph[static_cast<std::size_t>(row / scale)] >> (kGlyphWidth - 1 - column / scale) & 1) != 0;
        if (is_ink) Put(image, x + column, y + row, color);
      }
    }
    x += (kGlyphWidth + 1) * scale;
  }
}

// Maps values to pixels.
class Axes {
 public:
  explicit Axes(const std::vector<MergeRun>& runs) {
    double least = 1e9;
    double greatest = 1e-9;
    for (const MergeRun& run : runs) {
      maps_low_ = std::min(maps_low_, std::log10(static_cast<double>(run.maps)));
      maps_high_ = std::max(maps_high_, std::log10(static_cast<double>(run.maps)));
      for (const Line& line : Lines()) {
        const std::optional<double> value = line.value_ms(run);
        if (!value) continue;
        least = std::min(least, *value);
        greatest = std::max(greatest, *value);
      }
    }
    ms_low_ = std::floor(std::log10(least));
    ms_high_ = std::ceil(std::log10(greatest));
    if (maps_high_ <= maps_low_) maps_high_ = maps_low_ + 1;
  }

  double X(double maps) const {
    return kLeft + (std::log10(maps) - maps_low_) / (maps_high_ - maps_low_) * (kRight - kLeft);
  }
  double Y(double ms) const { return kBottom - (std::log10(ms) - ms_low_) / (ms_high_ - ms_low_) * (kBottom - kTop); }

  void Draw(Image& image, const std::vector<MergeRun>& runs) const {
    for (int power = static_cast<int>(ms_low_); power <= static_cast<int>(ms_high_); ++power) {
      const double ms = std::pow(10, power);
      const int y = static_cast<int>(Y(ms));
      DrawStroke(image, kLeft, y, kRight, y, kPale, 1);
      const std::string text = power >= 0 ? std::to_string(static_cast<int>(std::lround(ms)))
                                          : "0." + std::string(static_cast<std::size_t>(-power - 1), '0') + "1";
      DrawText(image, kLeft - 12 - static_cast<int>(text.size()) * 12, y - 7, text, kInk);
    }
    for (const MergeRun& run : runs) {
      const int x = static_cast<int>(X(static_cast<double>(run.maps)));
      DrawStroke(image, x, kTop, x, kBottom, kPale, 1);
      const std::string text = std::to_string(run.maps);
      DrawText(image, x - static_cast<int>(text.size()) * 6, kBottom + 12, text, kInk);
    }
    DrawStroke(image, kLeft, kBottom, kRight, kBottom, kInk, 1);
    DrawStroke(image, kLeft, kTop, kLeft, kBottom, kInk, 1);
    DrawText(image, (kLeft + kRight) / 2 - 30, kBottom + 40, "maps", kInk);
    DrawText(image, 16, 16, "milliseconds for one merged map", kInk);
  }

 private:
  double maps_low_ = 9;
  double maps_high_ = 0;
  double ms_low_ = 0;
  double ms_high_ = 1;
};

// Draws the lines and writes each line's name at its last point. Names that would overlap are moved apart.
void DrawLines(Image& image, const std::vector<MergeRun>& runs, const Axes& axes) {
  std::vector<std::pair<double, Line>> ends;
  for (const Line& line : Lines()) {
    std::optional<std::pair<double, double>> last;
    for (const MergeRun& run : runs) {
      const std::optional<double> value = line.value_ms(run);
      if (!value) continue;
      const double x = axes.X(static_cast<double>(run.maps));
      const double y = axes.Y(*value);
      if (last) DrawStroke(image, last->first, last->second, x, y, line.color, 3);
      DrawStroke(image, x, y, x, y, line.color, 9);
      last = {x, y};
    }
    if (last) ends.emplace_back(last->second, line);
  }
  std::sort(ends.begin(), ends.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  double below = kTop - 20;
  for (const auto& [y, line] : ends) {
    const double at = std::max(y - 7, below + 22);
    DrawText(image, kRight + 16, static_cast<int>(at), line.name, line.color, line.name.size() > 20 ? 1 : 2);
    below = at;
  }
}

}  // namespace

Image PlotOf(const std::vector<MergeRun>& runs) {
  Image image(kWidth, kHeight, 3, 255);
  if (runs.empty()) return image;
  const Axes axes(runs);
  axes.Draw(image, runs);
  DrawLines(image, runs, axes);
  return image;
}

}  // namespace moondb
