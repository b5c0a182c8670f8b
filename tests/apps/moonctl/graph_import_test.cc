#include "apps/moonctl/graph_import.h"

#include <gtest/gtest.h>

#include "apps/common/arguments.h"
#include "apps/moonctl/mistyped.h"
#include "apps/moonctl/team_letters.h"

namespace moondb {
namespace {

proto::TeamConfig Team(int rovers, bool has_base) {
  proto::TeamConfig team;
  for (int i = 1; i <= rovers + (has_base ? 1 : 0); ++i) {
    proto::AgentConfig& agent = *team.add_agents();
    agent.set_id(static_cast<std::uint32_t>(10 * i));
    agent.set_name("agent" + std::to_string(i));
    if (i > rovers) agent.set_kind(proto::AGENT_KIND_BASE_STATION);
  }
  return team;
}

// Two rovers (A, B) with one odometry step each, a base station (L) and an unknown landmark (M). Ranges lead from A to
// B, from B to L and from A to M.
constexpr char kGraph[] =
    "VERTEX_SE2 0 A0 1 2 0\n"
    "VERTEX_SE2 10 A1 50 50 0\n"
    "VERTEX_SE2 0 B0 5 5 1.5707963267948966\n"
    "VERTEX_SE2 10 B1 60 60 0\n"
    "VERTEX_XY L0 -1 -2\n"
    "VERTEX_XY M0 9 9\n"
    "EDGE_SE2 10 A0 A1 2 0 0 1 0 0 1 0 1\n"
    "EDGE_SE2 10 B0 B1 2 0 0 1 0 0 1 0 1\n"
    "EDGE_RANGE 10 A1 B1 4 0.01\n"
    "EDGE_RANGE 10 B1 L0 4 0.01\n"
    "EDGE_RANGE 10 A1 M0 4 0.01\n";

TEST(TeamLettersTest, GivesRoversTheAlphabetWithoutTheBaseStationsLetter) {
  const auto agents = AgentsByLetter(Team(13, true));
  EXPECT_EQ(agents.at(AgentOfLetter('A')), 10u);
  EXPECT_EQ(agents.at(AgentOfLetter('K')), 110u);
  EXPECT_EQ(agents.at(AgentOfLetter('M')), 120u);
  EXPECT_EQ(agents.at(AgentOfLetter('L')), 140u);
}

TEST(GraphImportTest, SeparatesOdometryFromLoopClosuresAndPriors) {
  const auto pyfg = ParsePyfg(std::string(kGraph) +
                                  "VERTEX_SE2 20 A2 70 70 0\n"
                                  "EDGE_SE2 20 A1 A2 2 0 0 1 0 0 1 0 1\n"
                                  "EDGE_SE2 20 A0 A2 9 9 0 1 0 0 1 0 1\n"
                                  "EDGE_SE2 0 A2 A0 -9 -9 0 1 0 0 1 0 1\n"
                                  "EDGE_SE2 10 A1 B1 3 0 0 1 0 0 1 0 1\n"
                                  "EDGE_SE2 10 A1 B1 3 0 0 1 0 0 1 0 1\n"
                                  "VERTEX_SE2:PRIOR 10 B1 3 0 0 1 0 0 1 0 1\n"
                                  "VERTEX_XY:PRIOR 10 M0 3 0 1 0 1\n",
                              "test");
  ASSERT_TRUE(pyfg.has_value()) << ToString(pyfg.error());
  const auto import = PrepareImport(Team(2, true), *pyfg);
  ASSERT_TRUE(import.has_value()) << ToString(import.error());
  EXPECT_EQ(import->counts.odometry, 3u);
  // Two between A0 and A2, and two between A1 and B1.
  EXPECT_EQ(import->counts.closures, 4u);
  EXPECT_EQ(import->counts.priors, 1u);
  // The import leaves out the landmark M0, its range and its prior.
  EXPECT_EQ(import->left_out_count, 3u);
  std::vector<std::string> sources;
  for (const auto& [agent, records] : import->records) {
    for (const proto::Record& record : records) {
      if (!record.pose_graph_edge().source().empty()) sources.push_back(record.pose_graph_edge().source());
      EXPECT_EQ(record.pose_prior().source(), record.has_pose_prior() ? "file" : "");
    }
  }
  EXPECT_EQ(sources, (std::vector<std::string>{"file", "file", "file", "file_2"}));
  const auto& last = import->records.at(10)[2].pose_graph_node();
  EXPECT_EQ(last.node().index(), 2u);
  EXPECT_NEAR(last.map_from_node().position_m().x(), 5, 1e-12);
}

TEST(GraphImportTest, ComposesRawPosesFromOdometryAndNeverTakesLaterVertices) {
  const auto pyfg = ParsePyfg(kGraph, "test");
  ASSERT_TRUE(pyfg.has_value()) << ToString(pyfg.error());
  const auto import = PrepareImport(Team(2, true), *pyfg);
  ASSERT_TRUE(import.has_value()) << ToString(import.error());
  EXPECT_EQ(import->counts.nodes, 5u);
  EXPECT_EQ(import->counts.odometry, 2u);
  EXPECT_EQ(import->counts.ranges, 2u);
  EXPECT_EQ(import->left_out_count, 2u);  // The landmark M0 and its range.

  const auto& rover2 = import->records.at(20);
  ASSERT_EQ(rover2.size(), 4u);  // Two nodes, an odometry step, and the range to the base station.
  const auto& node = rover2[1].pose_graph_node();
  EXPECT_EQ(node.node().index(), 1u);
  EXPECT_NEAR(node.map_from_node().position_m().x(), 5, 1e-12);
  EXPECT_NEAR(node.map_from_node().position_m().y(), 7, 1e-12);
  EXPECT_EQ(rover2[3].pose_graph_edge().to().agent_id(), 30u);
  ASSERT_EQ(import->records.at(30).size(), 1u);
  EXPECT_EQ(import->records.at(30)[0].pose_graph_node().map_from_node().position_m().y(), -2);
}

TEST(GraphImportTest, RefusesLettersWithoutAnAgent) {
  const auto pyfg = ParsePyfg(kGraph, "test");
  const auto import = PrepareImport(Team(1, true), *pyfg);
  ASSERT_FALSE(import.has_value());
  EXPECT_EQ(import.error().text, "no agent stands for the letter B: A is agent1, L is agent2");
}

TEST(GraphImportTest, SmallLettersStandForRoversUnlessTheyHaveAgentsOfTheirOwn) {
  const auto small = AgentsByLetterOfAnyCase(Team(2, true));
  EXPECT_EQ(small.at(AgentOfLetter('a')), 10u);
  EXPECT_EQ(small.at(AgentOfLetter('B')), 20u);
  EXPECT_FALSE(small.contains(AgentOfLetter('l'))) << "a landmark, not the base station";
  const auto large = AgentsByLetterOfAnyCase(Team(26, true));
  EXPECT_EQ(large.at(AgentOfLetter('a')), 260u);
  EXPECT_FALSE(large.contains(AgentOfLetter('b')));
}

TEST(GraphImportTest, RefusesARobotWithTwoLetters) {
  const auto pyfg = ParsePyfg("VERTEX_SE2 0 A0 0 0 0\nVERTEX_SE2 1 a0 1 0 0\n", "test");
  ASSERT_TRUE(pyfg.has_value()) << ToString(pyfg.error());
  const auto import = PrepareImport(Team(1, false), *pyfg);
  ASSERT_FALSE(import.has_value());
  EXPECT_EQ(import.error().text, "the letters A and a stand for the same agent: use one of them");
}

TEST(GraphImportTest, RefusesANodeThatOdometryDoesNotReach) {
  const auto pyfg = ParsePyfg("VERTEX_SE2 0 A0 0 0 0\nVERTEX_SE2 1 A1 1 0 0\n", "test");
  ASSERT_TRUE(pyfg.has_value()) << ToString(pyfg.error());
  const auto import = PrepareImport(Team(1, false), *pyfg);
  ASSERT_FALSE(import.has_value());
  EXPECT_NE(import.error().text.find("A1"), std::string::npos);
}

TEST(MistypedTest, FindsTheWordAndItsNeighbour) {
  Command app;
  bool is_json = false;
  std::string agent;
  app.AddFlag("--json", is_json);
  app.AddOption("-a,--agent", agent);
  Command& role = app.AddSubcommand("role", "");
  role.AddSubcommand("show", "");
  EXPECT_EQ(DescribeMistyped(app, {"rloe"}), "unknown command \"rloe\"; did you mean \"role\"?");
  EXPECT_EQ(DescribeMistyped(app, {"--agent", "rloe", "role", "shwo"}),
            "unknown command \"shwo\"; did you mean \"show\"?");
  EXPECT_EQ(DescribeMistyped(app, {"role", "show", "--jsn"}), "unknown option --jsn; did you mean \"--json\"?");
  EXPECT_EQ(DescribeMistyped(app, {"role", "show", "--json", "rover3"}),
            "unexpected \"rover3\" after \"role show\"; an agent is named by -a rover3");
  EXPECT_EQ(DescribeMistyped(app, {"role", "show", "10s"}),
            "unexpected \"10s\" after \"role show\"; a time limit is --timeout 10s");
  role.AddSubcommand("set", "").AddOption("agent", agent);
  EXPECT_EQ(DescribeMistyped(app, {"role", "set", "more"}), std::nullopt);
  EXPECT_EQ(DescribeMistyped(app, {"stop"}), "unknown command \"stop\"; use moonctl down");
  EXPECT_EQ(DescribeMistyped(app, {"role", "get"}), "unknown command \"get\"; use moonctl role show");
}

}  // namespace
}  // namespace moondb
