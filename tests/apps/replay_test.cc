// Replays a recorded mission through real processes. Skipped unless MOONDB_DATA is set.

#include <gmock/gmock.h>
#include <google/protobuf/util/json_util.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <future>
#include <thread>

#include "apps/common/proto_json.h"
#include "model/text.h"
#include "model/tum.h"
#include "proto/status.pb.h"
#include "tests/apps/process_team.h"

namespace moondb {
namespace {

using testing::HasSubstr;

class ReplayTest : public ProcessTeam {
 protected:
  void SetUp() override {
    const char* data = std::getenv("MOONDB_DATA");
    if (data == nullptr) GTEST_SKIP() << "MOONDB_DATA is not set: no recorded mission to replay";
    mission_ = std::filesystem::path(data) / "orebro_team";
    ProcessTeam::SetUp();
  }

  // Makes a team of the mission's agents, which replaces the usual team.
  void MakeTeam() {
    std::filesystem::create_directories(folder_ / "m");
    const std::string before = team_file_;
    team_file_ = folder_ / "m" / "team.yaml";
    environment_["MOONDB_TEAM"] = team_file_;
    MoonctlExpecting(0, {"config", "init", "--mission", mission_, team_file_});
    AdaptToTest(team_file_, folder_ / "m");
  }

  Outcome Replay(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), MOONDB_REPLAY_PROGRAM);
    return Run(std::move(arguments));
  }

  std::filesystem::path mission_;
};

double Figure(const google::protobuf::Struct& figures, const std::string& part, const std::string& name) {
  return figures.fields().at(part).struct_value().fields().at(name).number_value();
}

TEST_F(ReplayTest, MakesAMissionsTrajectoriesAndMapBetterOnTwoAgentsAlike) {
  MakeTeam();
  MoonctlExpecting(0, {"up", "--merge-backend", "cpu"});
  // Feeds both halves of the mission, the second one twice. No record may be stored twice.
  for (const auto& span : {std::pair("--to", "200"), {"--from", "200"}, {"--from", "200"}}) {
    const Outcome fed = Replay({"feed", "--mission", mission_, span.first, span.second});
    ASSERT_EQ(fed.exit_code, 0) << fed.error;
  }
  MoonctlExpecting(0, {"sync", "now", "--wait"});
  MoonctlExpecting(0, {"graph", "optimize"});
  MoonctlExpecting(0, {"replicate", "now", "--wait"});
  for (const std::string agent : {"rover1", "rover2"}) {
    const auto out = folder_ / ("score_" + agent);
    const Outcome scored =
        Replay({"score", "--mission", mission_, "-a", agent, "--out", out, "--json", out / "score.json"});
    ASSERT_EQ(scored.exit_code, 0) << scored.error;
    google::protobuf::Struct figures;
    ASSERT_TRUE(google::protobuf::util::JsonStringToMessage(*ReadTextFile(out / "score.json"), &figures).ok());
    EXPECT_EQ(figures.fields().at("map_count").number_value(), 117);
    EXPECT_TRUE(figures.fields().at("is_agents_map_equal").bool_value());
    EXPECT_LT(Figure(figures, "after", "ate_m"), Figure(figures, "before", "ate_m"));
    EXPECT_GT(Figure(figures, "after", "hazard_iou"), Figure(figures, "before", "hazard_iou"));
    for (const std::string name :
         {"merged_before", "merged_after", "merged_truth", "before_after", "trajectories", "rover1"}) {
      EXPECT_TRUE(std::filesystem::exists(out / (name + ".png"))) << name;
      EXPECT_TRUE(std::filesystem::exists(out / (name + ".svg"))) << name;
    }
    const double after_m = Figure(figures, "after", "ate_m");
    const Outcome aligned =
        Replay({"score", "--mission", mission_, "-a", agent, "--out", out, "--json", out / "score.json", "--align"});
    ASSERT_EQ(aligned.exit_code, 0) << aligned.error;
    ASSERT_TRUE(google::protobuf::util::JsonStringToMessage(*ReadTextFile(out / "score.json"), &figures).ok());
    EXPECT_LT(Figure(figures, "after", "ate_m"), after_m);
    EXPECT_TRUE(figures.fields().at("is_agents_map_equal").bool_value());
    RecordProperty("figures_" + agent, *ReadTextFile(out / "score.json"));
    std::cout << scored.out;
  }
}

TEST_F(ReplayTest, FeedsAtTheMissionsPaceAndWaitsForAnAgentThatIsAway) {
  MakeTeam();
  MoonctlExpecting(0, {"up", "--merge-backend", "cpu"});
  const auto start = std::chrono::steady_clock::now();
  auto feeding = std::async(std::launch::async, [this] {
    return Replay({"feed", "--mission", mission_, "--to", "100", "--speed", "20"});
  });
  EXPECT_TRUE(Until([this] { return KeysHeldBy("rover2").size() > 5; }));
  ASSERT_EQ(::kill(static_cast<pid_t>(Connect("rover2")->Status()->pid()), SIGKILL), 0);
  std::this_thread::sleep_until(start + std::chrono::seconds(3));  // Some of its records are due meanwhile.
  MoonctlExpecting(0, {"up", "--merge-backend", "cpu"});
  const Outcome fed = feeding.get();
  EXPECT_EQ(fed.exit_code, 0) << fed.error;
  EXPECT_GE(std::chrono::steady_clock::now() - start, std::chrono::seconds(4)) << "100 s of the mission";
  EXPECT_THAT(fed.error, HasSubstr("rover2 accepts no records now"));
  const Outcome again = Replay({"feed", "--mission", mission_, "--to", "100"});
  EXPECT_THAT(again.out, AllOf(HasSubstr("rover1: 0 records"), HasSubstr("rover2: 0 records")));
  EXPECT_EQ(Replay({"feed", "--mission", mission_, "--speed", "0"}).exit_code, 2);
}

TEST_F(ReplayTest, ImportsAGraphAndExportsIt) {
  MakeTeam();
  MoonctlExpecting(0, {"up", "--merge-backend", "cpu"});
  const auto imported = MoonctlJson(0, {"graph", "import", mission_ / "graph.pyfg"});
  const auto exported = [&] {
    MoonctlExpecting(0, {"sync", "now", "--wait"});
    return MoonctlJson(0, {"graph", "export", folder_ / "out.pyfg", "--poses", "raw"});
  }();
  for (const char* count : {"nodes", "odometry", "ranges"}) {
    EXPECT_EQ(exported.fields().at(count).number_value(), imported.fields().at(count).number_value()) << count;
    EXPECT_GT(imported.fields().at(count).number_value(), 60) << count;
  }
  MoonctlExpecting(0, {"graph", "export", folder_ / "tracks", "--format", "tum"});
  for (const char* rover : {"rover1", "rover2", "rover3"}) {
    const auto track = ReadTum(folder_ / "tracks" / (std::string(rover) + ".tum"));
    ASSERT_TRUE(track) << ToString(track.error());
    EXPECT_GT(track->size(), 10u);
  }
}

}  // namespace
}  // namespace moondb
