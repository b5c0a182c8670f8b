// Tests the merge policy of the paper's Section 5.1 with pictures in golden/*.pgm. Each picture shows the maps side by
// side, and then the merged map. Hazards are black, free cells white and unknown cells grey.
//
// To write the pictures again, set MOONDB_WRITE_GOLDEN=1. Look at each new picture before committing it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "actors/merge/cpu_gather.h"
#include "actors/merge/gl_gather.h"
#include "tests/actors/merge/merge_worlds.h"

namespace moondb {
namespace {

using Rows = std::vector<std::string>;

constexpr std::uint32_t kFine = 100'000;
constexpr std::uint32_t kCoarse = 200'000;
constexpr int kGap = 3;

std::string PictureOf(const std::string& title, const Rows& legend, const std::vector<Rows>& panels) {
  Rows lines(panels[0].size());
  for (const Rows& rows : panels) {
    for (std::size_t y = 0; y < rows.size(); ++y) {
      if (!lines[y].empty()) lines[y].append(kGap, '|');
      lines[y] += rows[y];
    }
  }
  std::ostringstream text;
  text << "P2\n# " << title << "\n";
  for (const std::string& line : legend) text << "# " << line << "\n";
  text << "#\n";
  for (const std::string& line : lines) text << "#   " << line << "\n";
  text << "#\n" << lines[0].size() << " " << lines.size() << "\n255\n";
  for (const std::string& line : lines) {
    for (std::size_t x = 0; x < line.size(); ++x) {
      text << (x == 0 ? "" : " ") << (line[x] == '#' ? "  0" : line[x] == '.' ? "254" : line[x] == '|' ? "120" : "205");
    }
    text << "\n";
  }
  return text.str();
}

class PolicyPictureTest : public testing::Test {
 protected:
  PolicyPictureTest() { world_.grid = {.resolution_um = kFine, .footprint_length_m = 0.6, .footprint_width_m = 0.4}; }

  void Put(const std::string& what, AgentId agent, std::int64_t timestamp_ns, const Rows& rows,
           std::uint32_t resolution_um = kFine) {
    const auto local = MakeLocalMap(MapKey(agent, world_.maps.size() + 1), timestamp_ns,
                                    DrawMap(rows, resolution_um, agent), world_.grid);
    ASSERT_TRUE(local.has_value());
    world_.maps.push_back({*local, Pose{}});
    legend_.push_back(what);
  }

  void PutFootprint(const std::string& what, const Pose& pose) {
    world_.footprints.push_back({{1, world_.footprints.size()}, pose});
    legend_.push_back(what);
  }

  // Merges `part`. Returns the merged cells within the extent of world_, which contains all maps.
  Rows Show(const World& part, std::shared_ptr<GatherBackend> backend) const {
    Merger whole(world_.grid, backend);
    whole.Assign(world_.maps, world_.footprints);
    EXPECT_TRUE(whole.Merge({}).has_value());
    Merger merger(world_.grid, backend);
    merger.Assign(part.maps, part.footprints);
    EXPECT_TRUE(merger.Merge({}).has_value());
    return Print(*merger.ReadCells(whole.extent()));
  }

  void ExpectPicture(const std::string& name, const std::string& title) {
    std::vector<Rows> panels;
    for (const PlacedMap& map : world_.maps) panels.push_back(Show({world_.grid, {map}, {}}, cpu_));
    for (const Footprint& footprint : world_.footprints) panels.push_back(Show({world_.grid, {}, {footprint}}, cpu_));
    panels.push_back(Show(world_, cpu_));
    legend_.push_back("merged");
    Rows legend;
    for (std::size_t i = 0; i < legend_.size(); ++i) legend.push_back(std::to_string(i + 1) + ": " + legend_[i]);
    const std::string picture = PictureOf(title, legend, panels);
    const std::filesystem::path file =
        std::filesystem::path(MOONDB_SOURCE_DIR) / "tests/actors/merge/golden" / (name + ".pgm");
    if (std::getenv("MOONDB_WRITE_GOLDEN") != nullptr) std::ofstream(file) << picture;
    std::ifstream stream(file);
    std::stringstream golden;
    golden << stream.rdbuf();
    EXPECT_EQ(picture, golden.str()) << file;
    ExpectSameByGl();
  }

  void ExpectSameByGl() const {
    Result<std::unique_ptr<GlGather>> gl = GlGather::Create({});
    if (!gl) return;
    EXPECT_EQ(Show(world_, std::move(*gl)), Show(world_, cpu_));
  }

  const std::shared_ptr<GatherBackend> cpu_ = std::make_shared<CpuGather>(CpuGather::Options{});
  World world_;
  Rows legend_;
};

const Rows kFieldWithRover = {"............", "............", "....####....",
                              "....####....", "............", "............"};
const Rows kField = {"............", "............", "............", "............", "............", "............"};

TEST_F(PolicyPictureTest, ARoverSeenByAnotherIsClearedByANewerMap) {
  Put("rover 2 sees rover 1 standing there", 2, 10, kFieldWithRover);
  Put("rover 3 sees the place when rover 1 has left", 3, 20,
      {"            ", "  ........  ", "  ........  ", "  ........  ", "  ........  ", "            "});
  ExpectPicture("rover_cleared_by_newer_map", "A rover seen by another is cleared by a newer map.");
}

TEST_F(PolicyPictureTest, ARoverSeenByAnotherIsClearedByItsFootprint) {
  Put("rover 2 sees rover 1 standing there", 2, 10, kFieldWithRover);
  PutFootprint("footprint of rover 1 at its node", Pose::FromPlanar(0.6, 0.3, 0));
  ExpectPicture("rover_cleared_by_footprint", "A rover seen by another is cleared by its own footprint.");
}

TEST_F(PolicyPictureTest, AFootprintWinsOverNewerAndFinerHazards) {
  Put("newest and finest: hazards everywhere", 2, 99, Rows(6, std::string(12, '#')));
  PutFootprint("footprint of rover 1, turned", Pose::FromPlanar(0.6, 0.3, 0.7));
  ExpectPicture("footprint_above_all", "Cells under a rover are free, whatever any map says.");
}

TEST_F(PolicyPictureTest, APhantomIsClearedByANewerMapOfTheSameResolution) {
  Put("a phantom obstacle", 1, 10, {"............", "..##........", "..##........", "............"});
  Put("newer, of the same resolution", 1, 20, {"            ", " ....       ", " ....       ", "            "});
  ExpectPicture("phantom_cleared_by_same_resolution", "A phantom is cleared by a newer map of the same resolution.");
}

TEST_F(PolicyPictureTest, APhantomIsClearedByAFinerMap) {
  Put("a phantom obstacle, coarse", 1, 10, {"......", ".##...", "......"}, kCoarse);
  Put("newer and finer", 1, 20,
      {"            ", " .....      ", " .....      ", " .....      ", "            ", "            "});
  ExpectPicture("phantom_cleared_by_finer_map", "A phantom is cleared by a newer map of a higher resolution.");
}

TEST_F(PolicyPictureTest, ANewerCoarserFreeCellDoesNotFreeAFineHazard) {
  Put("fine: a rock", 1, 10,
      {"            ", "   ....     ", "   .##.     ", "   ....     ", "            ", "            "});
  Put("newer, coarse: nothing there", 2, 20, {"......", "......", "......"}, kCoarse);
  ExpectPicture("coarse_free_over_fine_hazard", "A newer, coarser map does not free a fine hazard.");
}

TEST_F(PolicyPictureTest, AnOlderFinerFreeCellWinsOverANewerCoarserHazard) {
  Put("fine: a free lane", 1, 10, {"            ", "............", "            ", "            "});
  Put("newer, coarse: hazards", 1, 20, {"######", "######"}, kCoarse);
  ExpectPicture("fine_free_against_coarse_hazard", "An older, finer free cell stands against a newer, coarser hazard.");
}

// Read literally, Eq. (1) of the paper gives a fine hazard the resolution of a newer, coarser map that confirms the
// hazard. The next coarse map would then free the hazard.
TEST_F(PolicyPictureTest, AnEqualValueDoesNotTakeTheCoarserTag) {
  Put("fine: a rock", 1, 10, {"            ", "   ##       ", "            ", "            "});
  Put("newer, coarse: a rock too", 1, 20, {"  #   ", "      "}, kCoarse);
  Put("newest, coarse: free", 1, 30, {"......", "......"}, kCoarse);
  ExpectPicture("equal_value_keeps_its_tag",
                "A hazard that a coarser map confirms keeps its finer resolution, so that coarse maps do not free it.");
}

TEST_F(PolicyPictureTest, TheLargerAgentAndThenTheLaterRecordDecideBetweenEqualTimestamps) {
  Put("rover 2", 2, 10, {"......      ", "......      ", "      ......"});
  Put("rover 1, at the same time", 1, 10, {"############", "            ", "############"});
  Put("rover 2, at the same time, its next record", 2, 10, {"  ##        ", "            ", "        ##  "});
  ExpectPicture("equal_timestamps", "At equal timestamps the larger agent decides, then the later record.");
}

TEST_F(PolicyPictureTest, AnUnknownCellDoesNotReplaceAKnownOne) {
  Put("coarse", 1, 10, {"###...", "###..."}, kCoarse);
  Put("newer, fine, mostly unknown", 1, 20, {"            ", " ..      ## ", " ..      ## ", "            "});
  Put("newest, coarse, all unknown but one cell", 1, 30, {"      ", "     #"}, kCoarse);
  ExpectPicture("unknown_over_known", "Unknown never hides what is known, however fine or new it is.");
}

}  // namespace
}  // namespace moondb
