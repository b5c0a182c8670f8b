#include "model/mission.h"

#include <gmock/gmock.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <iterator>

#include "model/metrics.h"
#include "model/png.h"

namespace moondb {
namespace {

using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;

std::string Slurp(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

void Spit(const std::filesystem::path& file, const std::string& text) { std::ofstream(file, std::ios::binary) << text; }

void Replace(const std::filesystem::path& file, const std::string& from, const std::string& to) {
  std::string text = Slurp(file);
  const std::size_t at = text.find(from);
  ASSERT_NE(at, std::string::npos) << from;
  Spit(file, text.replace(at, from.size(), to));
}

TraversabilityMap MapOf(NodeKey node) {
  TraversabilityMap map{node, Pose::FromPlanar(0.2, 0, 0), {}};
  for (std::uint32_t layer = 0; layer < 2; ++layer) {
    map.layers.push_back(MapLayer{Grid(3, 3), 50'000u << layer, 0, 0});
    map.layers.back().grid.At(0, 2) = Cell::kHazard;
    map.layers.back().grid.At(2, static_cast<std::int32_t>(layer)) = Cell::kFree;
  }
  return map;
}

// A mission on disk: two rovers with two nodes each, a base station and two maps.
class MissionTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::path(testing::TempDir()) / ("moondb_mission_" + std::to_string(getpid()) + info->name());
    std::filesystem::remove_all(folder_);
    mission_.agents = {{7, "rover1", false, 'A', Pose::FromPlanar(1, 0, 0), 0.05, 0.01, {0.1, 0, 0.3}},
                       {3, "rover2", false, 'B', Pose::FromPlanar(0, 5, 0.5), 0.05, 0.01, {0.1, 0, 0.3}},
                       {4, "base", true, 'L', Pose::FromPlanar(-2, 0, 0), 0, 0, {0, 0, 1.5}}};
    const Pose step{Eigen::Vector3d(0.5, 0, 0.01), Pose::FromPlanar(0, 0, 0.1).orientation};
    for (const AgentId id : {7u, 3u}) {
      const Pose start = FindAgent(mission_, id)->start;
      mission_.graph.nodes.push_back({{id, 0}, 0, start});
      mission_.graph.nodes.push_back({{id, 1}, 10'000'000'000, start * step});
      mission_.truth[{id, 0}] = Pose{start.position_m + Eigen::Vector3d(0.03, 0.04, 0), start.orientation};
      mission_.truth[{id, 1}] = Pose{(start * step).position_m, start.orientation};
      mission_.graph.odometry.push_back({{id, 0}, {id, 1}, 10'000'000'000, step, Matrix6d::Identity() * 0.01});
    }
    mission_.graph.nodes.push_back({{4, 0}, 0, FindAgent(mission_, 4)->start});
    mission_.truth[{4, 0}] = FindAgent(mission_, 4)->start;
    mission_.graph.ranges = {{{7, 0}, {3, 0}, 0, 5.1, 0.01}, {{7, 0}, {4, 0}, 0, 3, 0.01}};
    mission_.maps = {{"A0", 7, 0, {7, 0}, Pose::FromPlanar(0.2, 0, 0), 2, 3, 0.05, "maps/A0000.png"},
                     {"B1", 3, 10'000'000'000, {3, 1}, Pose::FromPlanar(0.2, 0, 0), 2, 3, 0.05, "maps/B0001.png"}};
    ASSERT_TRUE(WriteMission(mission_, folder_));
    std::filesystem::create_directories(folder_ / "maps");
    for (const MissionMap& map : mission_.maps) ASSERT_TRUE(WriteMissionMap(folder_ / map.file, MapOf(map.node)));
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  // Returns the error of ReadMission as "file:line: text", or "no error".
  std::string ErrorOfReading() {
    const Result<Mission> mission = ReadMission(folder_);
    return mission ? "no error" : ToString(mission.error());
  }

  std::filesystem::path folder_;
  Mission mission_;
};

TEST_F(MissionTest, ReadsBackWhatWasWritten) {
  const Result<Mission> read = ReadMission(folder_);
  ASSERT_TRUE(read) << ToString(read.error());
  EXPECT_THAT(RoverIds(*read), ElementsAre(7u, 3u));
  ASSERT_EQ(read->agents.size(), 3u);
  EXPECT_EQ(read->agents[1].name, "rover2");
  EXPECT_EQ(read->agents[1].start_sigma_rad, 0.01);
  EXPECT_NEAR(read->agents[1].start.Yaw(), 0.5, 1e-15);
  EXPECT_EQ(read->agents[0].antenna_m, Eigen::Vector3d(0.1, 0, 0.3));
  EXPECT_TRUE(read->agents[2].is_base_station);
  EXPECT_EQ(read->graph.nodes.size(), 5u);
  EXPECT_EQ(read->graph.ranges.at(1).to, (NodeKey{4, 0}));
  EXPECT_EQ(read->maps.at(1).node, (NodeKey{3, 1}));
  EXPECT_EQ(read->maps.at(1).timestamp_ns, 10'000'000'000);
  EXPECT_EQ(read->truth.at({7, 0}).position_m, Eigen::Vector3d(1.03, 0.04, 0));
  EXPECT_EQ(read->truth.at({4, 0}).position_m, Eigen::Vector3d(-2, 0, 0));
}

TEST_F(MissionTest, ComposesRawPosesFromStartAndOdometryAlone) {
  const Result<Mission> read = ReadMission(folder_);
  ASSERT_TRUE(read) << ToString(read.error());
  const std::map<NodeKey, Pose> raw = PosesOf(read->graph);
  EXPECT_EQ(raw.at({7, 0}).position_m, Eigen::Vector3d(1, 0, 0));
  EXPECT_TRUE(raw.at({7, 1}).position_m.isApprox(Eigen::Vector3d(1.5, 0, 0.01)));
  EXPECT_NEAR(raw.at({7, 1}).Yaw(), 0.1, 1e-12);
  EXPECT_EQ(raw.at({4, 0}).position_m, Eigen::Vector3d(-2, 0, 0));
}

TEST_F(MissionTest, ReadsBackAMapsGridsTheRightWayUp) {
  const Result<Mission> read = ReadMission(folder_);
  ASSERT_TRUE(read) << ToString(read.error());
  const Result<TraversabilityMap> map = ReadMissionMap(*read, read->maps[1]);
  ASSERT_TRUE(map) << ToString(map.error());
  const TraversabilityMap expected = MapOf({3, 1});
  ASSERT_EQ(map->layers.size(), 2u);
  EXPECT_EQ(map->layers[0].grid, expected.layers[0].grid);
  EXPECT_EQ(map->layers[1].grid, expected.layers[1].grid);
  EXPECT_EQ(map->layers[1].resolution_um, 100'000u);
  EXPECT_EQ(map->node_from_map.position_m.x(), 0.2);
  const Result<Image> image = ReadPng(folder_ / "maps/B0001.png");
  EXPECT_EQ(*image->At(0, 0), 0);    // Row 0 of the picture has the largest y.
  EXPECT_EQ(*image->At(2, 2), 254);  // The topmost layer in the picture is the finest.
  EXPECT_EQ(*image->At(2, 4), 254);
  EXPECT_EQ(*image->At(1, 1), 205);
}

TEST_F(MissionTest, NamesFileAndLineOfAMistake) {
  Replace(folder_ / "agents.csv", "rover,B", "rover,A");
  EXPECT_THAT(ErrorOfReading(), HasSubstr("agents.csv:3: key A occurs a second time"));
}

TEST_F(MissionTest, RefusesDoubledAgents) {
  Replace(folder_ / "agents.csv", "\n3,rover2", "\n7,rover2");
  EXPECT_THAT(ErrorOfReading(), HasSubstr("agents.csv:3: agent_id 7 occurs a second time"));
}

TEST_F(MissionTest, RefusesAnotherHeading) {
  Replace(folder_ / "maps.csv", "map_id,", "id,");
  EXPECT_THAT(ErrorOfReading(), HasSubstr("maps.csv:1: the heading is not map_id,"));
}

TEST_F(MissionTest, RefusesATruncatedRow) {
  const std::string text = Slurp(folder_ / "maps.csv");
  Spit(folder_ / "maps.csv", text.substr(0, text.size() - 22));
  EXPECT_THAT(ErrorOfReading(), HasSubstr("maps.csv:3: has 9 fields instead of 11"));
}

TEST_F(MissionTest, RefusesNumbersThatAreNotFinite) {
  Replace(folder_ / "agents.csv", "A,1,0,0", "A,nan,0,0");
  EXPECT_THAT(ErrorOfReading(), HasSubstr("agents.csv:2: start_x_m: 'nan' is not a finite number"));
}

TEST_F(MissionTest, RefusesAMapOfAMissingNode) {
  Replace(folder_ / "maps.csv", ",B1,0.2", ",B9,0.2");
  EXPECT_THAT(ErrorOfReading(), HasSubstr("maps.csv:3: node: graph.pyfg has no node 'B9'"));
}

TEST_F(MissionTest, RefusesAMapOutsideTheFolder) {
  Replace(folder_ / "maps.csv", "maps/A0000.png", "../A0000.png");
  EXPECT_THAT(ErrorOfReading(), HasSubstr("maps.csv:2: file: '../A0000.png' lies outside"));
}

TEST_F(MissionTest, RefusesANodeKeyOfAnUnknownAgent) {
  Replace(folder_ / "graph.pyfg", "VERTEX_XYZ L0", "VERTEX_XYZ M0");
  Replace(folder_ / "graph.pyfg", "A0 L0", "A0 M0");
  EXPECT_THAT(ErrorOfReading(), EndsWith("graph.pyfg: M0 belongs to no agent of agents.csv"));
}

TEST_F(MissionTest, RefusesANodeWithoutOdometry) {
  Replace(folder_ / "graph.pyfg", "EDGE_SE3:QUAT 10 B0 B1", "EDGE_SE3:QUAT 10 A0 A1");
  EXPECT_THAT(ErrorOfReading(), EndsWith("graph.pyfg: no odometry leads to B1"));
}

TEST_F(MissionTest, SaysWhichFileIsMissing) {
  std::filesystem::remove(folder_ / "graph.pyfg");
  const Result<Mission> read = ReadMission(folder_);
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(read.error().field, EndsWith("graph.pyfg"));
}

TEST_F(MissionTest, RefusesAPictureOfAnotherSizeOrMeaning) {
  const Result<Mission> read = ReadMission(folder_);
  ASSERT_TRUE(read) << ToString(read.error());
  ASSERT_TRUE(WritePng(Image(3, 5, 1, 205), folder_ / "maps/A0000.png"));
  EXPECT_THAT(ReadMissionMap(*read, read->maps[0]).error().text, HasSubstr("has 3 x 5 pixels"));
  ASSERT_TRUE(WritePng(Image(3, 6, 1, 77), folder_ / "maps/A0000.png"));
  EXPECT_THAT(ReadMissionMap(*read, read->maps[0]).error().text, HasSubstr("is 77"));
  ASSERT_TRUE(WritePng(Image(3, 6, 3, 205), folder_ / "maps/A0000.png"));
  EXPECT_EQ(ReadMissionMap(*read, read->maps[0]).error().text, "is not gray");
  std::filesystem::remove(folder_ / "maps/A0000.png");
  EXPECT_EQ(ReadMissionMap(*read, read->maps[0]).error().code, ErrorCode::kNotFound);
}

TEST(RecordedMissionTest, ReadsRecordedTeams) {
  const char* data = std::getenv("MOONDB_DATA");
  if (data == nullptr) GTEST_SKIP() << "MOONDB_DATA is not set";
  struct Case {
    const char* name;
    std::size_t maps, ranges, odometry;
    double odometry_ate_m;
  };
  for (const Case& c : {Case{"intel_team", 453, 306, 450, 2.13}, Case{"orebro_team", 117, 65, 114, 1.09}}) {
    SCOPED_TRACE(c.name);
    const Result<Mission> mission = ReadMission(std::filesystem::path(data) / c.name);
    ASSERT_TRUE(mission) << ToString(mission.error());
    EXPECT_EQ(mission->maps.size(), c.maps);
    EXPECT_EQ(mission->graph.ranges.size(), c.ranges);
    EXPECT_EQ(mission->graph.odometry.size(), c.odometry);
    const TrajectoryError error = CompareTrajectories(PosesOf(mission->graph), mission->truth, RoverIds(*mission));
    EXPECT_NEAR(error.rmse_m, c.odometry_ate_m, 0.005);
    EXPECT_EQ(error.missing_count, 0u);
    const Result<TraversabilityMap> map = ReadMissionMap(*mission, mission->maps.back());
    ASSERT_TRUE(map) << ToString(map.error());
    EXPECT_EQ(map->layers.size(), 4u);
    EXPECT_EQ(map->layers[3].resolution_um, 400'000u);
  }
}

}  // namespace
}  // namespace moondb
