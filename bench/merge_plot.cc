#include "bench/merge_plot.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <string>

#include "apps/picture/drawing.h"
#include "model/png.h"

namespace moondb {
namespace {

constexpr int kWidth = 1000;
constexpr int kHeight = 640;
constexpr int kLeft = 90;
constexpr int kRight = 730;
constexpr int kTop = 50;
constexpr int kBottom = 570;
constexpr double kFontPx = 17;
constexpr Color kInk = {40, 40, 40};
constexpr Color kPale = {225, 225, 225};

struct Line {
  std::string name;
  Color color;
  std::function<std::optional<double>(const MergeRun&)> value_ms;
};

std::vector<Line> Lines() {
  return {{"naive", {90, 90, 90}, [](const MergeRun& run) { return run.naive_ms; }},
          {"OpenCV, warp and copy", {180, 120, 30}, [](const MergeRun& run) { return run.opencv_ms; }},
          {"the paper's painter, GL", {150, 60, 150}, [](const MergeRun& run) { return run.painter_ms; }},
          {"moondb, GL", {200, 40, 40}, [](const MergeRun& run) { return run.gl_ms; }},
          {"moondb, CPU", {30, 90, 200}, [](const MergeRun& run) { return run.cpu_ms; }},
          {"one more map, GL", {240, 130, 130}, [](const MergeRun& run) { return run.incremental_gl_ms; }},
          {"one more map, CPU", {120, 170, 250}, [](const MergeRun& run) { return run.incremental_cpu_ms; }}};
}

void SetColor(cairo_t* canvas, const Color& color) {
  cairo_set_source_rgb(canvas, color[0] / 255.0, color[1] / 255.0, color[2] / 255.0);
}

void DrawStroke(cairo_t* canvas, double x0, double y0, double x1, double y1, const Color& color, double thickness) {
  cairo_move_to(canvas, x0, y0);
  cairo_line_to(canvas, x1, y1);
  SetColor(canvas, color);
  cairo_set_line_width(canvas, thickness);
  cairo_set_line_cap(canvas, CAIRO_LINE_CAP_ROUND);
  cairo_stroke(canvas);
}

double WidthOf(cairo_t* canvas, const std::string& text) {
  cairo_text_extents_t extents;
  cairo_text_extents(canvas, text.c_str(), &extents);
  return extents.x_advance;
}

void DrawText(cairo_t* canvas, double x, double baseline, const std::string& text, const Color& color) {
  SetColor(canvas, color);
  cairo_move_to(canvas, x, baseline);
  cairo_show_text(canvas, text.c_str());
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

  void Draw(cairo_t* canvas, const std::vector<MergeRun>& runs) const {
    for (int power = static_cast<int>(ms_low_); power <= static_cast<int>(ms_high_); ++power) {
      const double y = Y(std::pow(10, power));
      DrawStroke(canvas, kLeft, y, kRight, y, kPale, 1);
      const std::string text = fmt::format("{:g}", std::pow(10, power));
      DrawText(canvas, kLeft - 10 - WidthOf(canvas, text), y + 6, text, kInk);
    }
    for (const MergeRun& run : runs) {
      const double x = X(static_cast<double>(run.maps));
      DrawStroke(canvas, x, kTop, x, kBottom, kPale, 1);
      const std::string text = std::to_string(run.maps);
      DrawText(canvas, x - WidthOf(canvas, text) / 2, kBottom + 24, text, kInk);
    }
    DrawStroke(canvas, kLeft, kBottom, kRight, kBottom, kInk, 1);
    DrawStroke(canvas, kLeft, kTop, kLeft, kBottom, kInk, 1);
    DrawText(canvas, (kLeft + kRight) / 2.0 - 60, kBottom + 52, "number of maps", kInk);
    DrawText(canvas, 16, 28, "time for one merged map (ms)", kInk);
  }

 private:
  double maps_low_ = 9;
  double maps_high_ = 0;
  double ms_low_ = 0;
  double ms_high_ = 1;
};

// Draws the lines and writes each line's name at its last point. Names that would overlap are moved apart.
void DrawLines(cairo_t* canvas, const std::vector<MergeRun>& runs, const Axes& axes) {
  std::vector<std::pair<double, Line>> ends;
  for (const Line& line : Lines()) {
    std::optional<std::pair<double, double>> last;
    for (const MergeRun& run : runs) {
      const std::optional<double> value = line.value_ms(run);
      if (!value) continue;
      const double x = axes.X(static_cast<double>(run.maps));
      const double y = axes.Y(*value);
      if (last) DrawStroke(canvas, last->first, last->second, x, y, line.color, 3);
      DrawStroke(canvas, x, y, x, y, line.color, 9);
      last = {x, y};
    }
    if (last) ends.emplace_back(last->second, line);
  }
  std::sort(ends.begin(), ends.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  double above = kTop - 20;
  for (const auto& [y, line] : ends) {
    const double baseline = std::max(y + 6, above + 22);
    DrawText(canvas, kRight + 16, baseline, line.name, line.color);
    above = baseline;
  }
}

}  // namespace

Result<void> WritePlot(const std::vector<MergeRun>& runs, const std::filesystem::path& file) {
  return WriteDrawing(file, kWidth, kHeight, [&runs](cairo_t* canvas) {
    if (runs.empty()) return;
    cairo_select_font_face(canvas, "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(canvas, kFontPx);
    const Axes axes(runs);
    axes.Draw(canvas, runs);
    DrawLines(canvas, runs, axes);
  });
}

}  // namespace moondb
