// Tests of exported maps: other programs can read them, and an interrupted export leaves the whole map or no map.

#include <gmock/gmock.h>
#include <signal.h>

#include <random>
#include <thread>

#include "model/g2o.h"
#include "model/png.h"
#include "model/pyfg.h"
#include "model/text.h"
#include "model/tum.h"
#include "tests/apps/process_team.h"

namespace moondb {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;

// The node is 100 m from the origin. MapOf centres maps on the origin, away from the footprint of the rover.
constexpr char kNode[] =
    R"({"node": {"agent_id": 2}, "map_from_node": {"position_m": {"x": 100}, "orientation": {"w": 1}}})";

proto::Record MapOf(const Grid& grid, std::uint64_t node) {
  proto::Record record;
  record.set_timestamp_ns(1);
  proto::LocalTraversabilityMap& map = *record.mutable_local_traversability_map();
  map.mutable_node()->set_agent_id(2);
  map.mutable_node()->set_index(node);
  map.mutable_node_from_map()->mutable_position_m()->set_x(-100);
  map.mutable_node_from_map()->mutable_orientation()->set_w(1);
  proto::MapLayer& layer = *map.add_layers();
  layer.set_width_cells(static_cast<std::uint32_t>(grid.width));
  layer.set_height_cells(static_cast<std::uint32_t>(grid.height));
  layer.set_resolution_um(50'000);
  layer.set_cells(PackCells(grid));
  return record;
}

class ExportTest : public ProcessTeam {
 protected:
  // Starts a team, and inserts two maps of noise at rover2: one for an existing node, and one for a missing node. Then
  // kills rover3.
  void StartWithMap() {
    std::string team = *ReadTextFile(team_file_);
    ASSERT_TRUE(WriteTextFile(team_file_, team + "\nsite: {lat_deg: 7.4, lon_deg: -59, north_yaw_rad: 0.5}\n"));
    MoonctlExpecting(0, {"up"});
    MoonctlExpecting(0, {"record", "insert", "pose_graph_node", kNode, "-a", "rover2"});
    constexpr std::uint64_t kSeed = 11;
    SCOPED_TRACE("seed " + std::to_string(kSeed));
    std::mt19937_64 random(kSeed);
    Grid grid(60, 40);
    for (Cell& cell : grid.cells) cell = static_cast<Cell>(random() % 3);
    ASSERT_TRUE(Connect("rover2")->Insert({MapOf(grid, 0), MapOf(grid, 99)}));
    Kill("rover3");
    ASSERT_TRUE(Until([this] { return Moonctl({"health"}).out.find("does not reach rover3") != std::string::npos; }));
  }

  bool HasProgram(const std::string& name) { return Run({"/bin/sh", "-c", "command -v " + name}).exit_code == 0; }
};

TEST_F(ExportTest, WritesProvenanceAndMissingRecordsOfMaps) {
  StartWithMap();
  for (const char* format : {"nav2", "png", "geotiff"}) {
    const std::string out = MoonctlExpecting(0, {"-a", "rover2", "map", "export", folder_ / "map", "--format", format});
    EXPECT_THAT(out, HasSubstr("agent: rover2\n"));
    EXPECT_THAT(out, HasSubstr("maps: 1\nwaiting_maps: 1\n"));
    EXPECT_THAT(out, HasSubstr("out_of_reach: rover3\n"));
  }
  EXPECT_THAT(*ReadTextFile(folder_ / "map" / "map.yaml"), HasSubstr("# out_of_reach: rover3\n"));
  const auto json = MoonctlJson(0, {"-a", "rover2", "map", "export", folder_ / "map"});
  EXPECT_EQ(json.fields().at("notes").struct_value().fields().at("maps_of").string_value(), "rover2");
  EXPECT_EQ(json.fields().at("files").list_value().values_size(), 2);
}

TEST_F(ExportTest, WritesProvenanceOfGraphsIfTheFormatAllowsComments) {
  StartWithMap();
  const auto text_of = [this](const char* name) { return *ReadTextFile(folder_ / name); };
  const auto check = [](const std::string& notes) {
    EXPECT_THAT(notes, HasSubstr("agent: rover2\n"));
    EXPECT_THAT(
        notes, HasSubstr("poses: optimized; newer nodes extended by odometry; raw if a rover has no optimized pose\n"));
    EXPECT_THAT(notes, HasSubstr("nodes: 1\n"));
    EXPECT_THAT(notes, HasSubstr("optimized_nodes: 0\n"));
    EXPECT_THAT(notes, HasSubstr("out_of_reach: rover3\n"));
  };
  check(MoonctlExpecting(0, {"-a", "rover2", "graph", "export", folder_ / "g.pyfg"}));
  check(text_of("g.pyfg.origin.txt"));
  EXPECT_THAT(text_of("g.pyfg"), StartsWith("VERTEX_SE3:QUAT "));  // GTSAM's PyFG reader accepts no comments.
  EXPECT_TRUE(ReadPyfg(folder_ / "g.pyfg"));

  check(MoonctlExpecting(0, {"-a", "rover2", "graph", "export", folder_ / "g.g2o", "--format", "g2o"}));
  check(text_of("g.g2o.origin.txt"));
  EXPECT_EQ(text_of("g.g2o").find('#'), std::string::npos);  // Some g2o readers accept no comments.
  EXPECT_TRUE(ReadG2o(folder_ / "g.g2o"));

  check(MoonctlExpecting(0, {"-a", "rover2", "graph", "export", folder_ / "t", "--format", "tum"}));
  check(text_of("t/rover2.tum"));
  EXPECT_THAT(text_of("t/rover2.tum"), HasSubstr("# trajectory_of: rover2\n"));
  EXPECT_EQ(ReadTum(folder_ / "t" / "rover2.tum")->size(), 1u);

  const auto json = MoonctlJson(0, {"-a", "rover2", "graph", "export", folder_ / "g.pyfg"});
  EXPECT_EQ(json.fields().at("notes").struct_value().fields().at("out_of_reach").string_value(), "rover3");
  EXPECT_EQ(json.fields().at("origin_file").string_value(), folder_ / "g.pyfg.origin.txt");
}

TEST_F(ExportTest, WritesTheBaseStationAsTheFormatsOwnReaderTakesIt) {
  MoonctlExpecting(0, {"up"});
  constexpr char kBase[] =
      R"({"node": {"agent_id": 4}, "map_from_node": {"position_m": {"x": 1, "y": 2, "z": 3}, "orientation": {"w": 1}}})";
  MoonctlExpecting(0, {"record", "insert", "pose_graph_node", kBase, "-a", "base"});
  MoonctlExpecting(0, {"-a", "base", "graph", "export", folder_ / "g.pyfg"});
  EXPECT_EQ(*ReadTextFile(folder_ / "g.pyfg"), "VERTEX_XYZ L0 1 2 3\n");  // A landmark line has no timestamp.
}

TEST_F(ExportTest, AllFormatsHoldTheSameCells) {
  StartWithMap();
  for (const char* format : {"nav2", "png", "geotiff"}) {
    MoonctlExpecting(0, {"-a", "rover2", "map", "export", folder_ / "map", "--format", format});
  }
  if (!HasProgram("gdalinfo")) GTEST_SKIP() << "gdal-bin is not installed";
  const auto run = [this](const std::string& command) {
    const Outcome outcome = Run({"/bin/sh", "-c", "cd " + (folder_ / "map").string() + " && " + command});
    EXPECT_EQ(outcome.exit_code, 0) << command << "\n" << outcome.error;
    return outcome.out;
  };
  const std::string info = run("gdalinfo map.tif");
  EXPECT_THAT(info, HasSubstr("Azimuthal Equidistant"));
  EXPECT_THAT(info, HasSubstr("1737400,0"));
  EXPECT_THAT(info, HasSubstr("out_of_reach=rover3"));
  EXPECT_THAT(info, HasSubstr("NoData Value=0"));
  EXPECT_THAT(run("gdalinfo map.png"), HasSubstr("Pixel Size = (0.05"));

  // PROJ computes the longitude and latitude of a point 1 km east and 5 km north of the site. The expected values come
  // from the great-circle formula.
  const std::string at =
      run("echo 1000 5000 | gdaltransform -s_srs \"$(gdalsrsinfo -o proj4 map.tif | tr -d '\\n')\" -t_srs "
          "'+proj=longlat +R=1737400 +no_defs' | awk '{printf \"%.9f %.9f\", $1, $2}'");
  EXPECT_EQ(at, "-58.966732613 7.564888189");

  // Each pixel's class in the TIFF must match its colour in the PNG.
  run("gdal_translate -q -of ENVI map.tif tif.raw && gdal_translate -q -of ENVI map.png png.raw");
  const std::string tif = *ReadTextFile(folder_ / "map" / "tif.raw"), png = *ReadTextFile(folder_ / "map" / "png.raw");
  EXPECT_EQ(tif, png);
  EXPECT_GT(std::count(tif.begin(), tif.end(), '\2'), 500);
}

TEST_F(ExportTest, ReportsEachErrorInOneLine) {
  const auto check = [this](int exit_code, const std::string& text, const std::vector<std::string>& words) {
    const Outcome outcome = Moonctl(words);
    EXPECT_EQ(outcome.exit_code, exit_code) << outcome.error;
    EXPECT_THAT(outcome.error, HasSubstr(text));
    EXPECT_EQ(std::count(outcome.error.begin(), outcome.error.end(), '\n'), 1) << outcome.error;
    EXPECT_EQ(outcome.out, "");
  };
  check(2, "did you mean \"export\"?", {"map", "exprot", folder_ / "x"});
  check(2, "the team file gives no geographic position of the map",
        {"map", "export", folder_ / "x", "--format", "geotiff"});
  check(2, "no such file", {"map", "export", folder_ / "x", "-t", folder_ / "none.yaml"});
  check(2, "no such file", {"config", "show", folder_ / "none.yaml"});
  check(3, "rover1 is not running", {"map", "export", folder_ / "x", "-a", "rover1"});
  EXPECT_FALSE(std::filesystem::exists(folder_ / "x"));
  MoonctlExpecting(0, {"up"});
  check(1, "holds no map", {"map", "export", folder_ / "map"});
  EXPECT_FALSE(std::filesystem::exists(folder_ / "map"));
  check(2, "no such file", {"graph", "import", folder_ / "none.pyfg"});
  check(2, "no such file", {"graph", "solve", folder_ / "none.g2o"});
  check(2, "no such file", {"-a", "rover1", "record", "insert", "power", "@" + (folder_ / "none.json").string()});
  check(2, "none", {"config", "init", folder_ / "new.yaml", "--mission", folder_ / "none"});
  MoonctlExpecting(0, {"record", "insert", "pose_graph_node", kNode, "-a", "rover2"});
  check(1, "holds no map", {"map", "export", folder_ / "map", "-a", "rover2"});
  ASSERT_TRUE(Connect("rover2")->Insert({MapOf(Grid(4, 4, Cell::kFree), 0)}));
  check(1, "choose another one", {"map", "export", "/proc/nothing", "-a", "rover2"});
  check(1, "cannot be written", {"graph", "export", "/proc/nothing", "-a", "rover2"});
  const Outcome frozen = [this] {
    ::kill(PidOf("rover2"), SIGSTOP);
    const Outcome outcome = Moonctl({"map", "export", folder_ / "map", "-a", "rover2", "--timeout", "300ms"});
    ::kill(PidOf("rover2"), SIGCONT);
    return outcome;
  }();
  EXPECT_EQ(frozen.exit_code, 3) << frozen.error;
  EXPECT_THAT(frozen.error, HasSubstr("rover2 does not answer"));
}

TEST_F(ExportTest, LeavesAWholeMapOrNoneIfInterrupted) {
  StartWithMap();
  constexpr std::uint64_t kSeed = 7;
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  std::mt19937_64 random(kSeed);
  int finished = 0;
  for (int i = 0; i < 40; ++i) {
    const std::filesystem::path folder = folder_ / ("map" + std::to_string(i));
    Child child({MOONCTL_PROGRAM, "-a", "rover2", "map", "export", folder}, environment_, folder_);
    std::this_thread::sleep_for(std::chrono::milliseconds(random() % 60));
    child.Signal(SIGINT);
    finished += child.Wait().exit_code == 0 ? 1 : 0;
    if (!std::filesystem::exists(folder)) continue;
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder)) names.insert(entry.path().filename());
    EXPECT_EQ(names, (std::set<std::string>{"map.pgm", "map.yaml"}));
  }
  std::printf("%d of 40 had ended before they were interrupted\n", finished);
}

TEST_F(ExportTest, ReportsAClosedPipeAndStillWritesTheMap) {
  StartWithMap();
  const Outcome outcome = Run({"/bin/bash", "-c",
                               "set -o pipefail; (sleep 0.1; exec " MOONCTL_PROGRAM " -a rover2 map export " +
                                   (folder_ / "map").string() + ") | true"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.error, HasSubstr("the result cannot be written: Broken pipe"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "map" / "map.yaml"));
}

}  // namespace
}  // namespace moondb
