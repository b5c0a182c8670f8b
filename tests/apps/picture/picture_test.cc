#include "apps/picture/picture.h"

#include <gmock/gmock.h>
#include <unistd.h>

#include <cmath>
#include <limits>

#include "apps/picture/drawing.h"
#include "model/cell_colors.h"
#include "model/text.h"

namespace moondb {
namespace {

using testing::HasSubstr;

class PictureTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::path(testing::TempDir()) / ("moondb_picture_" + std::to_string(getpid()) + info->name());
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  Image Drawn(const Picture& picture) const {
    const auto written = WritePicture(picture, folder_ / "x.png");
    EXPECT_TRUE(written) << ToString(written.error());
    auto image = ReadPng(folder_ / "x.png");
    EXPECT_TRUE(image) << ToString(image.error());
    return *image;
  }

  std::filesystem::path folder_;
};

// A free map of side x side cells of 5 cm, with one hazard cell.
MergedMap MapWithOneHazard(std::int32_t side, std::int32_t column, std::int32_t row) {
  MergedMap map{Grid(side, side, Cell::kFree), 50'000, -10, 20};
  map.grid.At(column, row) = Cell::kHazard;
  return map;
}

Picture PictureOf(const MergedMap& map, std::vector<Track> tracks = {}) {
  Picture picture;
  picture.panels = {{"A title", RasterOf(map), std::move(tracks)}};
  return picture;
}

// The centre and the number of the pixels of one colour.
struct Blob {
  double column = 0;
  double row = 0;
  int count = 0;
};

Blob BlobOf(const Image& image, const Color& color) {
  Blob blob;
  for (int row = 0; row < image.height; ++row) {
    for (int column = 0; column < image.width; ++column) {
      if (!std::equal(color.begin(), color.end(), image.At(column, row))) continue;
      blob.column += column;
      blob.row += row;
      ++blob.count;
    }
  }
  if (blob.count > 0) {
    blob.column /= blob.count;
    blob.row /= blob.count;
  }
  return blob;
}

// Relative luminance by WCAG 2.1.
double Luminance(const std::array<double, 3>& linear) {
  return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
}

std::array<double, 3> Linear(const Color& color) {
  std::array<double, 3> linear{};
  for (int i = 0; i < 3; ++i) {
    const double value = color[i] / 255.0;
    linear[i] = value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
  }
  return linear;
}

double Contrast(const std::array<double, 3>& one, const std::array<double, 3>& other) {
  const auto [low, high] = std::minmax({Luminance(one), Luminance(other)});
  return (high + 0.05) / (low + 0.05);
}

// Simulates protanopia and deuteranopia on linear RGB by the matrices of Vienot, Brettel and Mollon (1999).
std::array<double, 3> Simulated(const std::array<double, 3>& c, bool is_protanopia) {
  if (is_protanopia) {
    const double yellow = 0.11238 * c[0] + 0.88762 * c[1];
    return {yellow, yellow, 0.00401 * c[0] - 0.00401 * c[1] + c[2]};
  }
  const double yellow = 0.29275 * c[0] + 0.70725 * c[1];
  return {yellow, yellow, -0.02234 * c[0] + 0.02234 * c[1] + c[2]};
}

TEST_F(PictureTest, CellsDifferInGreyAndWithAnyColourVision) {
  const auto& colors = CellColors();
  for (const bool is_protanopia : {true, false}) {
    const auto unknown = Simulated(Linear(colors[0]), is_protanopia);
    EXPECT_GE(Contrast(unknown, Simulated(Linear(colors[1]), is_protanopia)), 2.5);
    EXPECT_GE(Contrast(unknown, Simulated(Linear(colors[2]), is_protanopia)), 3);
  }
  EXPECT_GE(Contrast(Linear(colors[0]), Linear(colors[1])), 2.5);
  EXPECT_GE(Contrast(Linear(colors[0]), Linear(colors[2])), 3);
}

TEST_F(PictureTest, ShowsACellWhereItLies) {
  const Image left_below = Drawn(PictureOf(MapWithOneHazard(20, 2, 3)));
  const Image right_above = Drawn(PictureOf(MapWithOneHazard(20, 17, 16)));
  const Blob low = BlobOf(left_below, CellColors()[2]);
  const Blob high = BlobOf(right_above, CellColors()[2]);
  // The legend holds a sample of the same colour and size in both pictures.
  EXPECT_EQ(low.count, high.count);
  EXPECT_LT(low.column, high.column);
  EXPECT_GT(low.row, high.row);
}

TEST_F(PictureTest, ShowsASingleHazardAmongManyCellsPerPixel) {
  const Color hazard = CellColors()[2];
  const int without = BlobOf(Drawn(PictureOf(MergedMap{Grid(5000, 5000, Cell::kFree), 50'000, 0, 0})), hazard).count;
  EXPECT_GT(BlobOf(Drawn(PictureOf(MapWithOneHazard(5000, 2501, 2502))), hazard).count, without);
}

TEST_F(PictureTest, LeavesOutPointsFarFromAllOthers) {
  Track track{"rover1", {1, 2, 3}, TrackStyle::kLine, {{0, 0}, {1, 1}, {2, 1}}};
  Picture picture;
  picture.panels = {{"Tracks", {}, {track}}};
  const Image good = Drawn(picture);
  for (const double far_m : {1e12, -1e300, std::numeric_limits<double>::infinity(), std::nan("")}) {
    picture.panels[0].tracks[0].points.push_back({far_m, 0});
    EXPECT_EQ(Drawn(picture).bytes, good.bytes) << far_m;
  }
}

TEST_F(PictureTest, ShowsEachNameOnceInTheLegend) {
  const Track one{"odometry", {70, 70, 70}, TrackStyle::kDashed, {{0, 0}, {1, 1}}};
  const Track other{"odometry", {70, 70, 70}, TrackStyle::kDashed, {{0, 1}, {1, 0}}};
  Picture single, twice;
  single.panels = {{"", {}, {one}}};
  twice.panels = {{"", {}, {one, other}}};
  EXPECT_EQ(Drawn(single).height, Drawn(twice).height);
  Picture many;
  many.panels = {{"", {}, {}}};
  for (int i = 0; i < 40; ++i) {
    many.panels[0].tracks.push_back({"robot " + std::to_string(i), AgentColor(i), TrackStyle::kLine, one.points});
  }
  EXPECT_GT(Drawn(many).height, Drawn(single).height) << "a long legend wraps";
}

TEST_F(PictureTest, KeepsItsBoundsForAnyExtent) {
  Picture picture;
  EXPECT_GT(Drawn(picture).height, 0) << "no panel";
  picture.panels = {{"", {}, {}}};
  EXPECT_GT(Drawn(picture).height, 0) << "no track";
  picture.panels[0].tracks = {{"a", {}, TrackStyle::kLine, {{0, 0}, {0, 9000}}}};
  EXPECT_LT(Drawn(picture).height, 3 * picture.panel_width_px);
  picture.panels[0].tracks = {{"a", {}, TrackStyle::kLine, {{0, 0}, {9000, 0}}}};
  EXPECT_GT(Drawn(picture).height, picture.panel_width_px / 4);
  picture.panels[0].tracks = {{"a", {}, TrackStyle::kLine, {{3, 3}}}};
  EXPECT_GT(Drawn(picture).height, 0);
  EXPECT_GT(Drawn(PictureOf(MergedMap{})).height, 0);
}

TEST_F(PictureTest, WritesSvgWithoutFonts) {
  ASSERT_TRUE(WritePicture(PictureOf(MapWithOneHazard(20, 2, 3)), folder_ / "x.svg"));
  const auto text = ReadTextFile(folder_ / "x.svg");
  ASSERT_TRUE(text);
  EXPECT_THAT(*text, HasSubstr("<svg"));
  EXPECT_THAT(*text, testing::Not(HasSubstr("<text")));
  EXPECT_THAT(*text, HasSubstr("</svg>"));
}

TEST_F(PictureTest, RefusesOtherFileNamesAndSizes) {
  const Picture picture = PictureOf(MapWithOneHazard(20, 2, 3));
  EXPECT_EQ(WritePicture(picture, folder_ / "x.jpg").error().code, ErrorCode::kInvalid);
  EXPECT_EQ(WritePicture(picture, folder_ / "none" / "x.png").error().code, ErrorCode::kInternal);
  EXPECT_EQ(WritePicture(picture, folder_ / "none" / "x.svg").error().code, ErrorCode::kInternal);
  EXPECT_EQ(WriteDrawing(folder_ / "x.png", 0, 10, [](cairo_t*) {}).error().code, ErrorCode::kInvalid);
  EXPECT_EQ(WriteDrawing(folder_ / "x.png", 20'000, 10, [](cairo_t*) {}).error().code, ErrorCode::kInvalid);
}

TEST_F(PictureTest, TracksFollowTheOrderOfTheAgents) {
  std::map<NodeKey, Pose> poses;
  for (std::uint64_t i = 0; i < 10; ++i) poses[{1, i}] = Pose::FromPlanar(0.5 * static_cast<double>(i), 5, 0);
  const std::vector<Track> tracks = TracksOf(poses, {{2, "rover2"}, {1, "rover1"}});
  ASSERT_EQ(tracks.size(), 2u);
  EXPECT_TRUE(tracks[0].points.empty());
  ASSERT_EQ(tracks[1].points.size(), 10u);
  EXPECT_EQ(tracks[1].name, "rover1");
  EXPECT_EQ(tracks[1].points[9].x_m, 4.5);
  EXPECT_EQ(tracks[1].points[9].y_m, 5);
}

}  // namespace
}  // namespace moondb
