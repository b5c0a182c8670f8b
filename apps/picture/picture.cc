#include "apps/picture/picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <set>

#include "apps/picture/drawing.h"
#include "model/cell_colors.h"

namespace moondb {
namespace {

constexpr const char* kFont = "DejaVu Sans";
constexpr double kOutlierM = 10'000;
constexpr double kHeightPerWidthMin = 0.25;
constexpr double kHeightPerWidthMax = 2.5;
constexpr double kLegendRow = 1.7;  // Height of a row of the legend, in font sizes.
constexpr double kInk = 0.15;       // Grey level of text and axes.

struct Box {
  double left = 0;
  double bottom = 0;
  double right = 0;
  double top = 0;
  double width() const { return right - left; }
  double height() const { return top - bottom; }
};

// A box in pixels; y grows downwards.
struct Area {
  double left = 0;
  double top = 0;
  double width = 0;
  double height = 0;
};

double Median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Removes points that are not finite, or farther than kOutlierM from the median of all points.
void RemoveOutliers(std::vector<Panel>& panels) {
  std::vector<double> all_x, all_y;
  for (const Panel& panel : panels) {
    for (const Track& track : panel.tracks) {
      for (const MapPoint& point : track.points) {
        if (!std::isfinite(point.x_m) || !std::isfinite(point.y_m)) continue;
        all_x.push_back(point.x_m);
        all_y.push_back(point.y_m);
      }
    }
  }
  const double middle_x = Median(std::move(all_x)), middle_y = Median(std::move(all_y));
  for (Panel& panel : panels) {
    for (Track& track : panel.tracks) {
      std::erase_if(track.points, [=](const MapPoint& point) {
        return !(std::hypot(point.x_m - middle_x, point.y_m - middle_y) <= kOutlierM);
      });
    }
  }
}

// Returns the part of the frame `map` that all panels show, in metres.
Box ExtentOf(const std::vector<Panel>& panels) {
  Box box{INFINITY, INFINITY, -INFINITY, -INFINITY};
  const auto add = [&box](double x, double y) {
    box = {std::min(box.left, x), std::min(box.bottom, y), std::max(box.right, x), std::max(box.top, y)};
  };
  double margin = 0.04;
  for (const Panel& panel : panels) {
    const Raster& raster = panel.raster;
    if (!raster.cells.empty()) {
      const double cell_m = raster.resolution_um / 1e6;
      add(static_cast<double>(raster.origin_cell_x) * cell_m, static_cast<double>(raster.origin_cell_y) * cell_m);
      add(static_cast<double>(raster.origin_cell_x + raster.width) * cell_m,
          static_cast<double>(raster.origin_cell_y + raster.height) * cell_m);
      margin = 0;
    }
    for (const Track& track : panel.tracks) {
      for (const MapPoint& point : track.points) add(point.x_m, point.y_m);
    }
  }
  if (!(box.width() >= 0)) return {0, 0, 1, 1};
  const double around = std::max(margin * std::max(box.width(), box.height()), 1e-3);
  box = {box.left - around, box.bottom - around, box.right + around, box.top + around};
  const double wider = (box.height() / kHeightPerWidthMax - box.width()) / 2;
  if (wider > 0) box = {box.left - wider, box.bottom, box.right + wider, box.top};
  const double higher = (box.width() * kHeightPerWidthMin - box.height()) / 2;
  if (higher > 0) box = {box.left, box.bottom - higher, box.right, box.top + higher};
  return box;
}

// Returns the largest number that is at most `limit` and is 1, 2 or 5 times a power of ten.
double RoundLength(double limit) {
  const double power = std::pow(10, std::floor(std::log10(limit)));
  for (const double factor : {5.0, 2.0}) {
    if (factor * power <= limit) return factor * power;
  }
  return power;
}

std::string LengthText(double metres) {
  char text[32];
  if (metres >= 1000) {
    std::snprintf(text, sizeof text, "%g km", metres / 1000);
  } else {
    std::snprintf(text, sizeof text, "%g m", metres);
  }
  return text;
}

void SetColor(cairo_t* canvas, const Color& color) {
  cairo_set_source_rgb(canvas, color[0] / 255.0, color[1] / 255.0, color[2] / 255.0);
}

void SetInk(cairo_t* canvas) { cairo_set_source_rgb(canvas, kInk, kInk, kInk); }

double TextWidth(cairo_t* canvas, const std::string& text) {
  cairo_text_extents_t extents;
  cairo_text_extents(canvas, text.c_str(), &extents);
  return extents.x_advance;
}

// Writes text in ink with a white border, so that it is readable on any ground.
void WriteText(cairo_t* canvas, double x, double baseline, const std::string& text, double border_px = 0) {
  cairo_move_to(canvas, x, baseline);
  cairo_text_path(canvas, text.c_str());
  if (border_px > 0) {
    cairo_set_source_rgb(canvas, 1, 1, 1);
    cairo_set_line_join(canvas, CAIRO_LINE_JOIN_ROUND);
    cairo_set_line_width(canvas, 2 * border_px);
    cairo_stroke_preserve(canvas);
  }
  SetInk(canvas);
  cairo_fill(canvas);
}

struct LegendEntry {
  std::string name;
  Color color;
  bool is_cell = false;   // A colour of cells, not a track.
  bool is_point = false;  // A track with one point.
  TrackStyle style = TrackStyle::kLine;
};

// The entry's left edge and text baseline, in pixels of the picture.
struct PlacedEntry {
  LegendEntry entry;
  double x = 0;
  double baseline = 0;
};

std::vector<LegendEntry> LegendOf(const std::vector<Panel>& panels) {
  std::vector<LegendEntry> entries;
  std::set<std::string> names;
  for (const Panel& panel : panels) {
    for (const RasterClass& type : panel.raster.classes) {
      if (names.insert(type.name).second) entries.push_back({type.name, type.color, true, false, {}});
    }
  }
  for (const Panel& panel : panels) {
    for (const Track& track : panel.tracks) {
      if (track.points.empty() || !names.insert(track.name).second) continue;
      entries.push_back({track.name, track.color, false, track.points.size() == 1, track.style});
    }
  }
  return entries;
}

class Painter {
 public:
  Painter(const Picture& picture, std::vector<Panel> panels)
      : picture_(picture), panels_(std::move(panels)), extent_(ExtentOf(panels_)) {
    const double count = static_cast<double>(panels_.size());
    panel_width_ = std::clamp(picture.panel_width_px, 100, 4000);
    font_px_ = std::clamp(panel_width_ * count / 85, 13.0, 40.0);
    px_per_m_ = panel_width_ / extent_.width();
    panel_height_ = std::round(extent_.height() * px_per_m_);
    left_ = 4.8 * font_px_;
    gap_ = 1.2 * font_px_;
    top_ = 2.1 * font_px_;
    PlaceLegend();
  }

  int width() const {
    const double panels = static_cast<double>(panels_.size());
    return static_cast<int>(std::ceil(left_ + panels * (panel_width_ + gap_)));
  }
  int height() const { return static_cast<int>(std::ceil(LegendTop() + legend_rows_ * kLegendRow * font_px_)); }

  void Paint(cairo_t* canvas) {
    SetFont(canvas);
    for (std::size_t i = 0; i < panels_.size(); ++i) {
      const double left = left_ + static_cast<double>(i) * (panel_width_ + gap_);
      PaintPanel(canvas, panels_[i], {left, top_, panel_width_, panel_height_}, i == 0);
    }
    PaintLegend(canvas);
  }

 private:
  double LegendTop() const { return top_ + panel_height_ + 3.4 * font_px_; }

  void SetFont(cairo_t* canvas) const {
    cairo_select_font_face(canvas, kFont, CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(canvas, font_px_);
  }

  // Wraps the entries of the legend into rows. Widths of text are measured on a surface of their own, because the
  // height of the picture depends on the number of rows.
  void PlaceLegend() {
    cairo_surface_t* surface = cairo_image_surface_create(CAIRO_FORMAT_A8, 1, 1);
    cairo_t* canvas = cairo_create(surface);
    SetFont(canvas);
    double x = left_;
    for (LegendEntry& entry : LegendOf(panels_)) {
      const double needed = 3.2 * font_px_ + TextWidth(canvas, entry.name);
      if (x > left_ && x + needed > width()) {
        ++legend_rows_;
        x = left_;
      }
      legend_.push_back({std::move(entry), x, LegendTop() + ((legend_rows_ - 1) * kLegendRow + 1) * font_px_});
      x += needed;
    }
    cairo_destroy(canvas);
    cairo_surface_destroy(surface);
  }

  double X(const Area& area, double x_m) const { return area.left + (x_m - extent_.left) * px_per_m_; }
  double Y(const Area& area, double y_m) const { return area.top + (extent_.top - y_m) * px_per_m_; }

  void PaintPanel(cairo_t* canvas, const Panel& panel, const Area& area, bool is_first) {
    cairo_save(canvas);
    cairo_rectangle(canvas, area.left, area.top, area.width, area.height);
    cairo_clip(canvas);
    PaintRaster(canvas, panel.raster, area);
    for (const TrackStyle style : {TrackStyle::kBroad, TrackStyle::kThin, TrackStyle::kDashed, TrackStyle::kLine}) {
      for (const Track& track : panel.tracks) {
        if (track.style == style && !track.points.empty()) PaintTrack(canvas, track, area);
      }
    }
    PaintNames(canvas, panel, area);
    if (is_first) PaintScaleAndNorth(canvas, area);
    cairo_restore(canvas);
    PaintAxes(canvas, area, is_first);
    WriteText(canvas, area.left, area.top - 0.7 * font_px_, panel.title);
  }

  // Fills `area` with the raster. Each pixel shows the largest value of the cells that it covers.
  void PaintRaster(cairo_t* canvas, const Raster& raster, const Area& area) {
    if (raster.cells.empty()) return;
    const int columns = static_cast<int>(area.width), rows = static_cast<int>(area.height);
    cairo_surface_t* surface = cairo_image_surface_create(CAIRO_FORMAT_RGB24, columns, rows);
    if (cairo_surface_status(surface) == CAIRO_STATUS_SUCCESS) {
      const std::vector<CellRange> xs =
          RangesOf(columns, extent_.left, raster.resolution_um, raster.origin_cell_x, raster.width);
      // Row 0 of the picture is the largest y.
      const std::vector<CellRange> ys =
          RangesOf(rows, extent_.top - rows / px_per_m_, raster.resolution_um, raster.origin_cell_y, raster.height);
      unsigned char* bytes = cairo_image_surface_get_data(surface);
      const int stride = cairo_image_surface_get_stride(surface);
      for (int row = 0; row < rows; ++row) {
        auto* pixels = reinterpret_cast<std::uint32_t*>(bytes + static_cast<std::ptrdiff_t>(row) * stride);
        for (int column = 0; column < columns; ++column) {
          const Color& color = raster.classes[LargestValueIn(raster, xs[column], ys[rows - 1 - row])].color;
          pixels[column] = static_cast<std::uint32_t>(color[0] << 16 | color[1] << 8 | color[2]);
        }
      }
      cairo_surface_mark_dirty(surface);
    }
    cairo_set_source_surface(canvas, surface, area.left, area.top);
    cairo_pattern_set_filter(cairo_get_source(canvas), CAIRO_FILTER_NEAREST);
    cairo_paint(canvas);
    cairo_surface_destroy(surface);
  }

  // Cells [first, last) of one axis of a raster. Empty outside the raster.
  struct CellRange {
    int first = 0;
    int last = 0;
  };

  // Returns the range of cells that each of `count` pixels covers along one axis, which begins at `start_m`.
  std::vector<CellRange> RangesOf(int count, double start_m, std::uint32_t resolution_um, std::int64_t origin,
                                  std::int32_t size) const {
    const double cells_per_px = 1e6 / (px_per_m_ * resolution_um);
    const double start = start_m * 1e6 / resolution_um - static_cast<double>(origin);
    const auto clamped = [size](double cell) { return static_cast<int>(std::clamp<double>(cell, 0, size)); };
    std::vector<CellRange> ranges;
    for (int i = 0; i < count; ++i) {
      const double first = std::floor(start + i * cells_per_px);
      const double last = std::max(first + 1, std::ceil(start + (i + 1) * cells_per_px));
      ranges.push_back({clamped(first), clamped(last)});
    }
    return ranges;
  }

  static std::size_t LargestValueIn(const Raster& raster, const CellRange& xs, const CellRange& ys) {
    std::uint8_t value = 0;
    for (int y = ys.first; y < ys.last; ++y) {
      for (int x = xs.first; x < xs.last; ++x) {
        value = std::max(value, raster.cells[static_cast<std::size_t>(y) * raster.width + x]);
      }
    }
    return value;
  }

  void PaintTrack(cairo_t* canvas, const Track& track, const Area& area) {
    const double line_px = font_px_ / 6;
    if (track.points.size() == 1) return PaintSquare(canvas, track, area);
    for (const MapPoint& point : track.points) cairo_line_to(canvas, X(area, point.x_m), Y(area, point.y_m));
    StrokeTrack(canvas, track.style, track.color, line_px);
    if (track.style != TrackStyle::kLine) return;
    cairo_arc(canvas, X(area, track.points[0].x_m), Y(area, track.points[0].y_m), 2.2 * line_px, 0, 2 * M_PI);
    FillWithBorder(canvas, track.color, line_px);
  }

  static void StrokeTrack(cairo_t* canvas, TrackStyle style, const Color& color, double line_px) {
    cairo_set_line_join(canvas, CAIRO_LINE_JOIN_ROUND);
    if (style == TrackStyle::kLine) {
      cairo_set_source_rgba(canvas, 1, 1, 1, 0.9);
      cairo_set_line_width(canvas, 2 * line_px);
      cairo_stroke_preserve(canvas);
    }
    if (style == TrackStyle::kDashed) {
      const std::array<double, 2> dash = {2 * line_px, 1.5 * line_px};
      cairo_set_dash(canvas, dash.data(), dash.size(), 0);
    }
    cairo_set_line_width(canvas, style == TrackStyle::kBroad  ? 3 * line_px
                                 : style == TrackStyle::kLine ? line_px
                                                              : line_px / 2);
    SetColor(canvas, color);
    cairo_stroke(canvas);
    cairo_set_dash(canvas, nullptr, 0, 0);
  }

  static void FillWithBorder(cairo_t* canvas, const Color& color, double border_px) {
    cairo_set_source_rgb(canvas, 1, 1, 1);
    cairo_set_line_width(canvas, border_px);
    cairo_stroke_preserve(canvas);
    SetColor(canvas, color);
    cairo_fill(canvas);
  }

  void PaintSquare(cairo_t* canvas, const Track& track, const Area& area) {
    const double side = 0.6 * font_px_;
    cairo_rectangle(canvas, X(area, track.points[0].x_m) - side / 2, Y(area, track.points[0].y_m) - side / 2, side,
                    side);
    FillWithBorder(canvas, track.color, font_px_ / 6);
  }

  // Writes each robot's name at the end of its track. A name that would cover an earlier one is moved down.
  void PaintNames(cairo_t* canvas, const Panel& panel, const Area& area) {
    std::vector<Area> taken;
    for (const Track& track : panel.tracks) {
      if (track.style != TrackStyle::kLine || track.points.empty()) continue;
      Area box{X(area, track.points.back().x_m) + 0.5 * font_px_, Y(area, track.points.back().y_m) - 0.5 * font_px_,
               TextWidth(canvas, track.name), font_px_};
      box.left = std::clamp(box.left, area.left, std::max(area.left, area.left + area.width - box.width));
      box.top = std::clamp(box.top, area.top, std::max(area.top, area.top + area.height - 2 * box.height));
      for (const Area& other : taken) {
        const bool is_over = box.left < other.left + other.width && other.left < box.left + box.width &&
                             box.top < other.top + other.height && other.top < box.top + box.height;
        if (is_over) box.top = other.top + other.height;
      }
      taken.push_back(box);
      WriteText(canvas, box.left, box.top + 0.85 * font_px_, track.name, font_px_ / 8);
    }
  }

  void PaintScaleAndNorth(cairo_t* canvas, const Area& area) {
    const double length_m = RoundLength(extent_.width() / 4);
    const double left = area.left + font_px_, y = area.top + area.height - 0.9 * font_px_;
    const double right = left + length_m * px_per_m_;
    for (const auto& [width, level] : {std::pair{font_px_ / 2.5, 1.0}, std::pair{font_px_ / 5, kInk}}) {
      cairo_move_to(canvas, left, y);
      cairo_line_to(canvas, right, y);
      cairo_set_source_rgb(canvas, level, level, level);
      cairo_set_line_width(canvas, width);
      cairo_stroke(canvas);
    }
    WriteText(canvas, left, y - 0.5 * font_px_, LengthText(length_m), font_px_ / 8);

    const double tip_x = std::cos(picture_.north_yaw_rad), tip_y = -std::sin(picture_.north_yaw_rad);
    const double center_x = area.left + area.width - 2.6 * font_px_, center_y = area.top + 2.8 * font_px_;
    const double length = font_px_;
    cairo_move_to(canvas, center_x + length * tip_x, center_y + length * tip_y);
    cairo_line_to(canvas, center_x - length * (tip_x - 0.55 * tip_y), center_y - length * (tip_y + 0.55 * tip_x));
    cairo_line_to(canvas, center_x - 0.6 * length * tip_x, center_y - 0.6 * length * tip_y);
    cairo_line_to(canvas, center_x - length * (tip_x + 0.55 * tip_y), center_y - length * (tip_y - 0.55 * tip_x));
    cairo_close_path(canvas);
    FillWithBorder(canvas, {38, 38, 38}, font_px_ / 4);
    WriteText(canvas, center_x + 1.7 * length * tip_x - TextWidth(canvas, "N") / 2,
              center_y + 1.7 * length * tip_y + 0.36 * font_px_, "N", font_px_ / 8);
  }

  void PaintAxes(cairo_t* canvas, const Area& area, bool is_first) {
    SetInk(canvas);
    cairo_set_line_width(canvas, std::max(1.0, font_px_ / 16));
    cairo_rectangle(canvas, area.left, area.top, area.width, area.height);
    cairo_stroke(canvas);
    const double step_m = RoundLength(std::max(extent_.width(), extent_.height()) / 3);
    const double tick = font_px_ / 3;
    // Adding 0.0 turns -0 into 0.
    for (double x_m = std::ceil(extent_.left / step_m) * step_m + 0.0; x_m <= extent_.right; x_m += step_m) {
      Tick(canvas, X(area, x_m), area.top + area.height, 0, tick);
      const std::string text = TickText(x_m, step_m);
      WriteText(canvas, X(area, x_m) - TextWidth(canvas, text) / 2, area.top + area.height + 1.4 * font_px_, text);
    }
    WriteText(canvas, area.left + area.width / 2 - TextWidth(canvas, "x (m)") / 2,
              area.top + area.height + 2.7 * font_px_, "x (m)");
    if (!is_first) return;
    for (double y_m = std::ceil(extent_.bottom / step_m) * step_m + 0.0; y_m <= extent_.top; y_m += step_m) {
      Tick(canvas, area.left, Y(area, y_m), -tick, 0);
      const std::string text = TickText(y_m, step_m);
      WriteText(canvas, area.left - 0.5 * font_px_ - TextWidth(canvas, text), Y(area, y_m) + 0.36 * font_px_, text);
    }
    cairo_save(canvas);
    cairo_translate(canvas, area.left - 3.6 * font_px_, area.top + area.height / 2);
    cairo_rotate(canvas, -M_PI / 2);
    WriteText(canvas, -TextWidth(canvas, "y (m)") / 2, 0, "y (m)");
    cairo_restore(canvas);
  }

  static void Tick(cairo_t* canvas, double x, double y, double right, double down) {
    SetInk(canvas);
    cairo_move_to(canvas, x, y);
    cairo_line_to(canvas, x + right, y + down);
    cairo_stroke(canvas);
  }

  static std::string TickText(double value_m, double step_m) {
    char text[32];
    // Rounds to a multiple of `step_m`, because floating-point errors would print 0 as a number such as 1e-17.
    std::snprintf(text, sizeof text, "%g", std::round(value_m / step_m) * step_m);
    return text;
  }

  void PaintLegend(cairo_t* canvas) {
    for (const PlacedEntry& placed : legend_) {
      PaintSample(canvas, placed.entry, placed.x, placed.baseline);
      WriteText(canvas, placed.x + 2 * font_px_, placed.baseline, placed.entry.name);
    }
  }

  void PaintSample(cairo_t* canvas, const LegendEntry& entry, double x, double baseline) {
    if (entry.is_cell) {
      cairo_rectangle(canvas, x, baseline - 0.9 * font_px_, 1.6 * font_px_, 1.1 * font_px_);
      SetColor(canvas, entry.color);
      cairo_fill_preserve(canvas);
      SetInk(canvas);
      cairo_set_line_width(canvas, std::max(1.0, font_px_ / 16));
      cairo_stroke(canvas);
      return;
    }
    if (entry.is_point) {
      cairo_rectangle(canvas, x + 0.5 * font_px_, baseline - 0.65 * font_px_, 0.6 * font_px_, 0.6 * font_px_);
      return FillWithBorder(canvas, entry.color, font_px_ / 6);
    }
    cairo_move_to(canvas, x, baseline - 0.35 * font_px_);
    cairo_line_to(canvas, x + 1.6 * font_px_, baseline - 0.35 * font_px_);
    StrokeTrack(canvas, entry.style, entry.color, font_px_ / 6);
  }

  const Picture& picture_;
  std::vector<Panel> panels_;
  Box extent_;
  std::vector<PlacedEntry> legend_;
  int legend_rows_ = 1;
  double font_px_ = 0;
  double px_per_m_ = 0;
  double panel_width_ = 0;
  double panel_height_ = 0;
  double left_ = 0;
  double gap_ = 0;
  double top_ = 0;
};

}  // namespace

Raster RasterOf(const MergedMap& map) {
  Raster raster{map.grid.width, map.grid.height, map.resolution_um, map.origin_cell_x, map.origin_cell_y, {}, {}};
  raster.cells.reserve(map.grid.cells.size());
  for (const Cell cell : map.grid.cells) raster.cells.push_back(static_cast<std::uint8_t>(cell));
  const auto& colors = CellColors();
  raster.classes = {{colors[0], "unknown"}, {colors[1], "free"}, {colors[2], "hazard"}};
  return raster;
}

Result<void> WritePicture(const Picture& picture, const std::filesystem::path& file) {
  std::vector<Panel> panels = picture.panels;
  RemoveOutliers(panels);
  Painter painter(picture, std::move(panels));
  return WriteDrawing(file, painter.width(), painter.height(), [&painter](cairo_t* canvas) { painter.Paint(canvas); });
}

}  // namespace moondb
