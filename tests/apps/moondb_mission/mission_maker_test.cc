#include "apps/moondb_mission/mission_maker.h"

#include <gmock/gmock.h>
#include <unistd.h>

#include <algorithm>

#include "model/metrics.h"
#include "model/pyfg.h"
#include "model/text.h"

namespace moondb {
namespace {

using testing::HasSubstr;

MissionOptions ShortOptions(std::uint64_t seed) {
  MissionOptions options;
  options.seed = seed;
  options.minutes = 2;
  options.terrain.side_m = 25;
  return options;
}

class MissionMakerTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    folder_ =
        std::filesystem::path(testing::TempDir()) / ("moondb_mission_maker_" + std::to_string(getpid()) + info->name());
    std::filesystem::remove_all(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::filesystem::path folder_;
};

TEST_F(MissionMakerTest, ReaderAcceptsWhatItMakes) {
  const Result<MadeMission> made = MakeMission(ShortOptions(3));
  ASSERT_TRUE(made) << ToString(made.error());
  const Result<void> written = WriteMadeMission(*made, folder_);
  ASSERT_TRUE(written) << ToString(written.error());
  const Result<Mission> read = ReadMission(folder_);
  ASSERT_TRUE(read) << ToString(read.error());
  EXPECT_EQ(read->agents.size(), 4u);
  EXPECT_EQ(read->graph.nodes.size(), 3u * 13 + 1);
  EXPECT_EQ(read->graph.odometry.size(), 3u * 12);
  EXPECT_EQ(read->graph.ranges.size(), 5u * 6);
  EXPECT_EQ(read->maps.size(), 3u * 13);
  ASSERT_EQ(made->maps.size(), made->mission.maps.size());
  for (const MissionMap& map : read->maps) {
    const auto same = std::find_if(made->maps.begin(), made->maps.end(),
                                   [&map](const TraversabilityMap& m) { return m.node == map.node; });
    ASSERT_NE(same, made->maps.end());
    const Result<TraversabilityMap> grids = ReadMissionMap(*read, map);
    ASSERT_TRUE(grids) << ToString(grids.error());
    for (std::size_t layer = 0; layer < 4; ++layer) EXPECT_EQ(grids->layers[layer].grid, same->layers[layer].grid);
  }
  // The raw poses are restored from the files. They come from the start pose and the odometry, so they differ from the
  // truth.
  const std::map<NodeKey, Pose> raw = PosesOf(made->mission.graph);
  EXPECT_LT(CompareTrajectories(PosesOf(read->graph), raw, RoverIds(*read)).max_m, 1e-9);
  EXPECT_GT(CompareTrajectories(raw, made->mission.truth, RoverIds(*read)).rmse_m, 0.01);
}

TEST_F(MissionMakerTest, SameSeedMakesTheSameMission) {
  const Result<MadeMission> first = MakeMission(ShortOptions(5));
  const Result<MadeMission> second = MakeMission(ShortOptions(5));
  const Result<MadeMission> other = MakeMission(ShortOptions(6));
  ASSERT_TRUE(first && second && other);
  ASSERT_TRUE(WriteMadeMission(*first, folder_ / "first"));
  ASSERT_TRUE(WriteMadeMission(*second, folder_ / "second"));
  ASSERT_TRUE(WriteMadeMission(*other, folder_ / "other"));
  for (const char* file : {"agents.csv", "graph.pyfg", "maps.csv", "maps/A0000.png", "maps/C0012.png"}) {
    EXPECT_EQ(*ReadTextFile(folder_ / "first" / file), *ReadTextFile(folder_ / "second" / file)) << file;
  }
  EXPECT_NE(*ReadTextFile(folder_ / "first/graph.pyfg"), *ReadTextFile(folder_ / "other/graph.pyfg"));
}

TEST_F(MissionMakerTest, TruthStandsInVerticesAlone) {
  const Result<MadeMission> made = MakeMission(ShortOptions(8));
  ASSERT_TRUE(made);
  const Mission& mission = made->mission;
  for (const MissionAgent& agent : mission.agents) {
    if (agent.is_base_station) continue;
    // The error of a start pose has the standard deviation start_sigma_m, and is never exactly zero.
    const double off_m = (agent.start.position_m - mission.truth.at({agent.id, 0}).position_m).norm();
    EXPECT_GT(off_m, 1e-4);
    EXPECT_LT(off_m, 5 * agent.start_sigma_m);
  }
  for (const OdometryEdge& edge : mission.graph.odometry) {
    const Pose step = mission.truth.at(edge.from).Inverse() * mission.truth.at(edge.to);
    EXPECT_GT((edge.from_from_to.position_m - step.position_m).norm(), 1e-5);
  }
}

TEST_F(MissionMakerTest, OptionsOutOfRangeAreNamed) {
  MissionOptions options;
  options.rover_count = 9;
  EXPECT_EQ(MakeMission(options).error().field, "rovers");
  options = MissionOptions();
  options.minutes = 0;
  EXPECT_EQ(MakeMission(options).error().field, "minutes");
  options = MissionOptions();
  options.terrain.side_m = 1e9;
  EXPECT_EQ(MakeMission(options).error().field, "side_m");
  options = MissionOptions();
  options.minutes = 600;
  options.node_period_s = 1;
  EXPECT_THAT(MakeMission(options).error().text, HasSubstr("20000 maps"));
}

TEST_F(MissionMakerTest, AFullFolderIsLeftAlone) {
  std::filesystem::create_directories(folder_);
  ASSERT_TRUE(WriteTextFile(folder_ / "mine.txt", "keep"));
  const Result<MadeMission> made = MakeMission(ShortOptions(9));
  ASSERT_TRUE(made);
  const Result<void> written = WriteMadeMission(*made, folder_);
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().code, ErrorCode::kRefused);
}

}  // namespace
}  // namespace moondb
