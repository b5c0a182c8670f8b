// Reads the written GeoTIFF files with libtiff and libgeotiff.
#include "model/geotiff.h"

#include <geotiff/geo_normalize.h>
#include <geotiff/geotiffio.h>
#include <geotiff/xtiffio.h>
#include <gmock/gmock.h>

#include <cmath>
#include <fstream>
#include <numbers>

#include "model/cell_colors.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

using testing::HasSubstr;

constexpr MapSite kSite = {7.4, 301, 0.3};
const FileNotes kNotes = {{"agent", "rover1"}, {"out of reach", "<rover3> & \"base\""}};

// Returns a map with more rows than fit into one strip of a TIFF.
MergedMap TallMap() {
  MergedMap map{Grid(5, 150), 50'000, -7, 13};
  for (std::size_t i = 0; i < map.grid.cells.size(); ++i) map.grid.cells[i] = static_cast<Cell>(i * i % 3);
  return map;
}

class GeoTiffTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto bytes = GeoTiffBytes(TallMap(), kSite, kNotes);
    ASSERT_TRUE(bytes) << ToString(bytes.error());
    std::ofstream(folder_.File("map.tif"), std::ios::binary) << *bytes;
    TIFFSetWarningHandler(nullptr);  // libtiff would warn about GDAL's tags, which it does not know.
    tiff_ = XTIFFOpen(folder_.File("map.tif").c_str(), "r");
    ASSERT_NE(tiff_, nullptr);
  }
  void TearDown() override {
    if (tiff_ != nullptr) XTIFFClose(tiff_);
  }

  const TemporaryFolder folder_;
  TIFF* tiff_ = nullptr;
};

TEST_F(GeoTiffTest, HoldsEveryCellWithNorthUp) {
  const MergedMap map = TallMap();
  std::uint32_t width = 0, height = 0;
  TIFFGetField(tiff_, TIFFTAG_IMAGEWIDTH, &width);
  TIFFGetField(tiff_, TIFFTAG_IMAGELENGTH, &height);
  ASSERT_EQ(width, 5u);
  ASSERT_EQ(height, 150u);
  for (int row = 0; row < 150; ++row) {
    std::uint8_t pixels[5] = {};
    ASSERT_EQ(TIFFReadScanline(tiff_, pixels, static_cast<std::uint32_t>(row)), 1);
    for (int column = 0; column < 5; ++column) {
      EXPECT_EQ(pixels[column], static_cast<int>(map.grid.At(column, 149 - row))) << column << "," << row;
    }
  }
  std::uint16_t *red = nullptr, *green = nullptr, *blue = nullptr;
  ASSERT_EQ(TIFFGetField(tiff_, TIFFTAG_COLORMAP, &red, &green, &blue), 1);
  for (int i = 0; i < 3; ++i)
    EXPECT_EQ((Color{static_cast<std::uint8_t>(red[i] >> 8), static_cast<std::uint8_t>(green[i] >> 8),
                     static_cast<std::uint8_t>(blue[i] >> 8)}),
              CellColors()[i]);
}

TEST_F(GeoTiffTest, LiesOnTheMoonAboutTheSite) {
  GTIF* keys = GTIFNew(tiff_);
  ASSERT_NE(keys, nullptr);
  GTIFDefn definition;
  ASSERT_EQ(GTIFGetDefn(keys, &definition), 1);
  EXPECT_EQ(definition.Model, ModelTypeProjected);
  EXPECT_EQ(definition.SemiMajor, kMoonRadius_m);
  EXPECT_EQ(definition.SemiMinor, kMoonRadius_m);
  EXPECT_EQ(definition.CTProjection, CT_AzimuthalEquidistant);
  EXPECT_EQ(definition.UOMLengthInMeters, 1.0);
  ASSERT_GE(definition.nParms, 2);
  EXPECT_NEAR(definition.ProjParm[0], 7.4, 1e-12);
  EXPECT_NEAR(definition.ProjParm[1], -59, 1e-12) << "east, within 180 degrees";

  // libgeotiff computes the coordinates of some points of the raster.
  const MergedMap map = TallMap();
  for (const auto& [column, row] : {std::pair{0.0, 0.0}, {5.0, 0.0}, {5.0, 150.0}, {2.5, 75.0}}) {
    double x = column, y = row;
    ASSERT_EQ(GTIFImageToPCS(keys, &x, &y), 1);
    const double map_x = (-7 + column) * 0.05, map_y = (13 + 150 - row) * 0.05;
    const Eigen::Vector2d north(std::cos(0.3), std::sin(0.3)), east(std::sin(0.3), -std::cos(0.3));
    EXPECT_NEAR(x, east.dot(Eigen::Vector2d(map_x, map_y)), 1e-9);
    EXPECT_NEAR(y, north.dot(Eigen::Vector2d(map_x, map_y)), 1e-9);
  }
  GTIFFree(keys);
}

TEST_F(GeoTiffTest, ContainsItsProvenance) {
  const char* text = nullptr;
  ASSERT_EQ(TIFFGetField(tiff_, TIFFTAG_IMAGEDESCRIPTION, &text), 1);
  EXPECT_STREQ(text, "agent: rover1\nout of reach: <rover3> & \"base\"\n");
  std::uint32_t count = 0;
  ASSERT_EQ(TIFFGetField(tiff_, 42112, &count, &text), 1);
  EXPECT_THAT(text, HasSubstr("<Item name=\"out of reach\">&#60;rover3&#62; &#38; &#34;base&#34;</Item>"));
  ASSERT_EQ(TIFFGetField(tiff_, 42113, &count, &text), 1);
  EXPECT_STREQ(text, "0");
}

TEST(GeoTiffPlaceTest, NorthIsWhereItsYawPoints) {
  const Eigen::Vector2d place(3, 4);
  EXPECT_TRUE(EastNorth({0, 0, std::numbers::pi / 2}, place).isApprox(place)) << "y is north";
  EXPECT_TRUE(EastNorth({0, 0, 0}, place).isApprox(Eigen::Vector2d(-4, 3))) << "x is north, y is west";
  EXPECT_EQ(GeoTiffBytes(MergedMap{}, {}, {}).error().code, ErrorCode::kInvalid);
}

}  // namespace
}  // namespace moondb
