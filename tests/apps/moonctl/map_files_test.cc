#include "apps/moonctl/map_files.h"

#include <gmock/gmock.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <thread>

#include "model/png.h"
#include "model/text.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class MapFilesTest : public testing::Test {
 protected:
  MapExport Export(const std::string& format) {
    MapExport exported{folder_.path() / "out", format, {Grid(100, 80), 50'000, -100, 20}, {}, {{"agent", "rover1"}}};
    exported.map.grid.At(50, 40) = Cell::kHazard;
    exported.map.grid.At(52, 40) = Cell::kFree;
    return exported;
  }
  std::filesystem::path File(const std::string& name) { return folder_.path() / "out" / name; }

  const TemporaryFolder folder_;
};

TEST_F(MapFilesTest, APngLiesWhereItsWorldFileSays) {
  ASSERT_THAT(*WriteMapFiles(Export("png")), ElementsAre(File("map.pgw"), File("map.png")));
  const Image image = *ReadPng(File("map.png"));
  ASSERT_EQ(image.width, 43);  // Three cells with a margin of 20 cells on each side.
  ASSERT_EQ(image.height, 41);
  EXPECT_EQ(WrittenMap(Export("png")).grid.width, image.width);
  EXPECT_EQ(WrittenMap(Export("png")).grid.height, image.height);
  EXPECT_EQ(WrittenMap(Export("nav2")).grid.width, 100);
  std::vector<double> world;
  const std::string text = *ReadTextFile(File("map.pgw"));
  for (const std::string_view line : Split(text, '\n')) {
    if (!line.empty()) world.push_back(*ParseDouble(line));
  }
  // Compare the world coordinates of the centre of the hazard's pixel.
  ASSERT_EQ(image.At(20, 20)[0], 120);
  EXPECT_NEAR(world[0] * 20 + world[2] * 20 + world[4], (-100 + 50.5) * 0.05, 1e-12);
  EXPECT_NEAR(world[1] * 20 + world[3] * 20 + world[5], (20 + 40.5) * 0.05, 1e-12);
}

TEST_F(MapFilesTest, EachFormatHoldsTheNotes) {
  for (const char* format : {"nav2", "png", "geotiff"}) {
    const auto files = WriteMapFiles(Export(format));
    ASSERT_TRUE(files) << ToString(files.error());
    EXPECT_THAT(*ReadTextFile(files->back()), HasSubstr("rover1")) << format;
  }
}

// Paths of the two files of an export. The signal handler InspectFiles counts how often the first file exists without
// the second.
char picture_file[256];
char text_file[256];
std::atomic<int> half_count = 0;

void InspectFiles(int) {
  if (::access(picture_file, F_OK) == 0 && ::access(text_file, F_OK) != 0) ++half_count;
}

TEST_F(MapFilesTest, ASignalFindsBothFilesOrNone) {
  const auto before = std::signal(SIGINT, InspectFiles);
  const pthread_t writer = ::pthread_self();
  std::atomic<bool> is_done = false;
  std::thread sender([&] {
    while (!is_done) ::pthread_kill(writer, SIGINT);
  });
  for (int i = 0; i < 200; ++i) {
    MapExport exported = Export("nav2");
    exported.folder = folder_.path() / std::to_string(i);
    std::snprintf(picture_file, sizeof(picture_file), "%s/map.pgm", exported.folder.c_str());
    std::snprintf(text_file, sizeof(text_file), "%s/map.yaml", exported.folder.c_str());
    EXPECT_TRUE(WriteMapFiles(exported));
  }
  is_done = true;
  sender.join();
  std::signal(SIGINT, before);
  EXPECT_EQ(half_count, 0);
}

TEST_F(MapFilesTest, SaysWhatToDoWhereNothingCanBeWritten) {
  MapExport exported = Export("nav2");
  ASSERT_TRUE(WriteTextFile(folder_.path() / "file", "x"));
  exported.folder = folder_.path() / "file" / "out";
  EXPECT_THAT(WriteMapFiles(exported).error().text, HasSubstr("choose another one"));
  std::filesystem::create_directories(File("map.pgm") / "x");
  exported.folder = File("");
  const auto failed = WriteMapFiles(exported);
  ASSERT_FALSE(failed);
  EXPECT_THAT(failed.error().text, HasSubstr("choose another folder"));
  EXPECT_FALSE(std::filesystem::exists(File("map.yaml"))) << "no text without its picture";
  EXPECT_FALSE(std::filesystem::exists(File("map.pgm.new")));
}

TEST_F(MapFilesTest, LeavesTheFilesOfAnEarlierTimeWhereOneCannotBeWritten) {
  ASSERT_TRUE(WriteMapFiles(Export("nav2")));
  const std::string before = *ReadTextFile(File("map.pgm"));
  std::filesystem::create_directories(File("map.yaml.new"));  // The second file cannot be written.
  MapExport other = Export("nav2");
  other.map.grid.At(10, 10) = Cell::kHazard;
  ASSERT_FALSE(WriteMapFiles(other));
  EXPECT_EQ(*ReadTextFile(File("map.pgm")), before);
  EXPECT_FALSE(std::filesystem::exists(File("map.pgm.new")));
}

}  // namespace
}  // namespace moondb
