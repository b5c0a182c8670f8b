// Checks that other programs read the written PNG files and ROS maps.
#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <iterator>
#include <regex>

#include "model/cell_colors.h"
#include "model/png.h"
#include "model/ros_map.h"

namespace moondb {
namespace {

using testing::HasSubstr;

class MapFilesTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    folder_ =
        std::filesystem::path(testing::TempDir()) / ("moondb_map_files_" + std::to_string(getpid()) + info->name());
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string Slurp(const std::string& name) const {
    std::ifstream stream(folder_ / name, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }

  std::filesystem::path folder_;
};

MergedMap SmallMap() {
  MergedMap map{Grid(3, 2, Cell::kFree), 12'500, -3, 7};
  map.grid.At(0, 0) = Cell::kHazard;
  map.grid.At(2, 1) = Cell::kUnknown;
  return map;
}

double NumberAfter(const std::string& yaml, const std::string& key) {
  std::smatch match;
  EXPECT_TRUE(std::regex_search(yaml, match, std::regex(key + ": ([-0-9.e]+)"))) << key;
  return std::stod(match[1]);
}

TEST_F(MapFilesTest, PngKeepsEveryByteOfEachKind) {
  for (const int channels : {1, 3, 4}) {
    Image image(31, 17, channels);
    for (std::size_t i = 0; i < image.bytes.size(); ++i) image.bytes[i] = static_cast<std::uint8_t>(i * 7);
    // Avoid full transparency, because colours of transparent pixels may get lost.
    if (channels == 4) {
      for (std::size_t i = 3; i < image.bytes.size(); i += 4) image.bytes[i] = i % 8 == 3 ? 255 : 128;
    }
    ASSERT_TRUE(WritePng(image, folder_ / "x.png"));
    const Result<Image> read = ReadPng(folder_ / "x.png");
    ASSERT_TRUE(read) << ToString(read.error());
    EXPECT_EQ(read->channels, channels);
    EXPECT_EQ(read->width, 31);
    EXPECT_EQ(read->height, 17);
    EXPECT_EQ(read->bytes, image.bytes);
  }
}

TEST_F(MapFilesTest, PngErrorsAreValues) {
  ASSERT_EQ(::mkfifo((folder_ / "pipe.png").c_str(), 0600), 0);
  EXPECT_EQ(ReadPng(folder_ / "pipe.png").error().code, ErrorCode::kInvalid) << "nobody waits for its writer";
  EXPECT_EQ(ReadPng(folder_ / "none.png").error().code, ErrorCode::kNotFound);
  std::ofstream(folder_ / "text.png") << "no picture at all";
  EXPECT_EQ(ReadPng(folder_ / "text.png").error().code, ErrorCode::kCorrupt);
  std::ofstream(folder_ / "empty.png").close();
  EXPECT_EQ(ReadPng(folder_ / "empty.png").error().code, ErrorCode::kCorrupt);
  ASSERT_TRUE(WritePng(Image(200, 200, 3, 9), folder_ / "cut.png"));
  std::filesystem::resize_file(folder_ / "cut.png", std::filesystem::file_size(folder_ / "cut.png") / 2);
  EXPECT_EQ(ReadPng(folder_ / "cut.png").error().code, ErrorCode::kCorrupt);
  Image wrong(4, 4, 3);
  wrong.bytes.pop_back();
  EXPECT_EQ(WritePng(wrong, folder_ / "wrong.png").error().code, ErrorCode::kInvalid);
  EXPECT_EQ(WritePng(Image(4, 4, 2), folder_ / "wrong.png").error().code, ErrorCode::kInvalid);
  EXPECT_EQ(WritePng(Image(4, 4, 1), folder_ / "nowhere" / "x.png").error().code, ErrorCode::kInternal);
  std::filesystem::create_directories(folder_ / "taken.png" / "x");
  EXPECT_THAT(WritePng(Image(4, 4, 1), folder_ / "taken.png").error().text, HasSubstr("cannot be written: "));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "taken.png.part")) << "nothing half-written is left";
}

TEST_F(MapFilesTest, PngOfAHugePictureIsRefusedBeforeItIsRead) {
  ASSERT_TRUE(WritePng(Image(8, 8, 1), folder_ / "x.png"));
  std::string bytes = Slurp("x.png");
  bytes[16] = 0x10;  // A width of 268 million, refused without an allocation.
  std::ofstream(folder_ / "x.png", std::ios::binary) << bytes;
  EXPECT_FALSE(ReadPng(folder_ / "x.png"));
}

TEST_F(MapFilesTest, RosMapIsWrittenToTheByte) {
  EXPECT_EQ(RosMapYaml(SmallMap(), "map.pgm", {{"agent", "rover1"}, {"maps", "3"}}),
            "# agent: rover1\n# maps: 3\nimage: map.pgm\nmode: trinary\nresolution: 0.0125\norigin: [-0.0375, 0.0875, "
            "0]\nnegate: 0\n"
            "occupied_thresh: 0.65\nfree_thresh: 0.196\n");
  EXPECT_EQ(RosMapPgm(SmallMap().grid), "P5\n3 2\n255\n\xfe\xfe\xcd" + std::string(1, '\0') + "\xfe\xfe");
}

// Rule of the ROS map server: p = (255 - pixel) / 255; occupied above occupied_thresh, free below free_thresh.
TEST_F(MapFilesTest, RosMapLoadsWithTheSameCells) {
  const MergedMap map = SmallMap();
  const std::string yaml = RosMapYaml(map, "map.pgm");
  const std::string pgm = RosMapPgm(map.grid);
  const double occupied = NumberAfter(yaml, "occupied_thresh");
  const double free_below = NumberAfter(yaml, "free_thresh");
  const std::string pixels = pgm.substr(pgm.size() - map.grid.cells.size());
  for (std::int32_t row = 0; row < map.grid.height; ++row) {
    for (std::int32_t column = 0; column < map.grid.width; ++column) {
      const auto pixel = static_cast<unsigned char>(pixels[(map.grid.height - 1 - row) * map.grid.width + column]);
      const double p = (255.0 - pixel) / 255.0;
      const Cell loaded = p > occupied ? Cell::kHazard : p < free_below ? Cell::kFree : Cell::kUnknown;
      EXPECT_EQ(loaded, map.grid.At(column, row));
    }
  }
}

TEST_F(MapFilesTest, PngHoldsAPaletteAndSaysWhereItCameFrom) {
  const Image cells = CellPicture(SmallMap());
  EXPECT_EQ(cells.bytes, (std::vector<std::uint8_t>{1, 1, 0, 2, 1, 1}));
  const auto bytes =
      PngBytes(cells, {{CellColors().begin(), CellColors().end()}, {{"agent", "rover1"}, {"maps", "3"}}});
  ASSERT_TRUE(bytes) << ToString(bytes.error());
  EXPECT_THAT(*bytes, HasSubstr(std::string("tEXtagent\0rover1", 16)));
  std::ofstream(folder_ / "cells.png", std::ios::binary) << *bytes;
  const Result<Image> read = ReadPng(folder_ / "cells.png");
  ASSERT_TRUE(read) << ToString(read.error());
  ASSERT_EQ(read->channels, 3);
  for (int i = 0; i < 6; ++i) {
    const Color color = {read->bytes[3 * i], read->bytes[3 * i + 1], read->bytes[3 * i + 2]};
    EXPECT_EQ(color, CellColors()[cells.bytes[i]]) << i;
  }
  EXPECT_EQ(PngBytes(Image(2, 2, 3), {{{1, 2, 3}}, {}}).error().code, ErrorCode::kInvalid);
}

}  // namespace
}  // namespace moondb
