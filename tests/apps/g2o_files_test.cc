// Tests of g2o files as other programs write them: GTSAM, SC-LIO-SAM, RTAB-Map and distributed-mapper.

#include <gmock/gmock.h>

#include <array>

#include "model/text.h"
#include "tests/apps/process_team.h"

namespace moondb {
namespace {

using testing::HasSubstr;

constexpr char kInformation[] = " 100 0 0 0 0 0 100 0 0 0 0 100 0 0 0 100 0 0 100 0 100\n";
constexpr std::uint64_t kSmallA = std::uint64_t{'a'} << 56;  // The GTSAM symbols a0 and b0.
constexpr std::uint64_t kSmallB = std::uint64_t{'b'} << 56;

std::string EdgeLine(std::uint64_t from, std::uint64_t to, const std::string& pose = "1 0 0 0 0 0 1") {
  return "EDGE_SE3:QUAT " + std::to_string(from) + " " + std::to_string(to) + " " + pose + kInformation;
}

// Returns the lines of `count` vertices 1 m apart, with odometry from each to the next.
std::string RowOf(std::uint64_t first_id, int count) {
  std::string text;
  for (int i = 0; i < count; ++i) {
    const std::uint64_t id = first_id + static_cast<std::uint64_t>(i);
    text += "VERTEX_SE3:QUAT " + std::to_string(id) + " " + std::to_string(i) + " 0 0 0 0 0 1\n";
    if (i > 0) text += EdgeLine(id - 1, id);
  }
  return text;
}

class G2oFilesTest : public ProcessTeam {
 protected:
  std::string File(const std::string& name, const std::string& text) {
    EXPECT_TRUE(WriteTextFile(folder_ / name, text));
    return folder_ / name;
  }

  // Returns {nodes, odometry edges, loop closures} of the graph that an agent holds.
  std::array<double, 3> HeldBy(const std::string& agent) {
    const auto json = MoonctlJson(0, {"-a", agent, "graph", "export", folder_ / "held.pyfg"});
    const auto count = [&json](const char* name) { return json.fields().at(name).number_value(); };
    return {count("nodes"), count("odometry"), count("loop_closures")};
  }

  // Expects that `graph solve` and `graph import` refuse the file with `text` at `line`, and that rover2 stores
  // nothing.
  void ExpectRefusal(const std::string& file, int line, const std::string& text) {
    for (const std::vector<std::string>& words : {std::vector<std::string>{"graph", "solve", file},
                                                  std::vector<std::string>{"graph", "import", file, "-a", "rover2"}}) {
      const Outcome outcome = Moonctl(words);
      EXPECT_EQ(outcome.exit_code, 2) << words[1] << " " << outcome.out;
      EXPECT_THAT(outcome.error, HasSubstr(file + ":" + std::to_string(line) + ": " + text)) << words[1];
    }
    EXPECT_EQ(HeldBy("rover2")[0], 0) << file;
  }
};

TEST_F(G2oFilesTest, ImportsLabeledSymbolsAsNodesOfTheRobotOfTheLabel) {
  MoonctlExpecting(0, {"up"});
  const std::string file = File("labels.g2o", RowOf(std::uint64_t{'a'} << 48, 3));
  EXPECT_THAT(MoonctlExpecting(0, {"graph", "solve", file}), HasSubstr("cost 0 after"));
  EXPECT_THAT(MoonctlExpecting(0, {"graph", "import", file}), HasSubstr("inserted 3 nodes, 2 odometry edges"));
  EXPECT_THAT(MoonctlExpecting(0, {"graph", "import", file, "-a", "rover2"}), HasSubstr("nothing is new"));
  EXPECT_EQ(MoonctlExpecting(0, {"-a", "rover1", "record", "next-node"}), "3\n");
  EXPECT_EQ(MoonctlExpecting(0, {"-a", "rover2", "record", "next-node"}), "0\n");
  for (const std::string name : {"again.g2o", "again.pyfg"}) {
    MoonctlExpecting(0, {"graph", "export", folder_ / name, "--format", name.substr(6)});
    EXPECT_THAT(MoonctlExpecting(0, {"graph", "import", folder_ / name}), HasSubstr("nothing is new")) << name;
  }
}

TEST_F(G2oFilesTest, RefusesIdsThatAreNeitherSymbolsNorIndices) {
  MoonctlExpecting(0, {"up"});
  const std::string file = File("large.g2o", "# made by hand\n" + RowOf(std::uint64_t{1} << 40, 2));
  const Outcome outcome = Moonctl({"graph", "import", file, "-a", "rover2"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.error, HasSubstr(file + ":2: vertex 1099511627776"));
  EXPECT_THAT(outcome.error, HasSubstr("LabeledSymbol"));
  EXPECT_EQ(MoonctlExpecting(0, {"-a", "rover2", "record", "next-node"}), "0\n");
}

TEST_F(G2oFilesTest, RefusesFaultyLinesWithTheirCauseAndInsertsNothing) {
  MoonctlExpecting(0, {"up"});
  const std::string row = RowOf(0, 2);
  ExpectRefusal(File("a.g2o", row + "EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 1\n"), 4,
                "EDGE_SE3:QUAT 0 1 has no information matrix (21 numbers): --edge-sigmas");
  ExpectRefusal(File("b.g2o", row + "VERTEX_SE3:QUAT 2 0,125959 0,027604 0 0 0 0 1\n"), 4,
                "'0,125959' has a decimal comma: write 0.125959");
  ExpectRefusal(File("c.g2o", row + "EDGE_SE3_PRIOR 1 3 0 0 0 0 0 0 1" + kInformation), 4,
                "no line above defines the parameter 3: add PARAMS_SE3OFFSET 3 0 0 0 0 0 0 1");
  ExpectRefusal(File("e.g2o", row + "VERTEX_SE3 : QUAT 2 0 0 0 0 0 0 1\n"), 4, "a blank within 'VERTEX_SE3:QUAT'");
}

TEST_F(G2oFilesTest, EdgesWithoutAMatrixGetTheGivenSigmas) {
  MoonctlExpecting(0, {"up"});
  const std::string file = File("sc_lio_sam.g2o",
                                "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 1 1 0 0 0 0 0 1\n"
                                "EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 1\n");
  EXPECT_THAT(MoonctlExpecting(0, {"graph", "solve", file, "--edge-sigmas", "0.1,0.05"}), HasSubstr("2 nodes, 1 edge"));
  MoonctlExpecting(0, {"graph", "import", file, "--edge-sigmas", "0.1,0.05", "-a", "rover2"});
  EXPECT_EQ(HeldBy("rover2"), (std::array<double, 3>{2, 1, 0}));
  for (const std::string wrong : {"0.1", "0.1,0", "0.1,0.05,1", "-1,1", "nan,1", "1,1e5", "a,b", ""}) {
    const Outcome outcome = Moonctl({"graph", "solve", file, "--edge-sigmas=" + wrong});
    EXPECT_EQ(outcome.exit_code, 2) << wrong;
    EXPECT_THAT(outcome.error, HasSubstr("--edge-sigmas")) << wrong;
  }
}

TEST_F(G2oFilesTest, ReadsPriorsThatRepeatTheirVertexAndLastLinesWithoutAnEnd) {
  MoonctlExpecting(0, {"up"});
  const std::string file = File("rtabmap.g2o", RowOf(0, 2) + "EDGE_SE3_PRIOR 1 1 1 0 0 0 0 0 1" + kInformation +
                                                   "PARAMS_SE3OFFSET 0 0 0 0 0 0 0 1");
  EXPECT_THAT(MoonctlExpecting(0, {"graph", "solve", file}), HasSubstr("2 nodes, 1 edge, 0 ranges, 1 prior"));
  EXPECT_THAT(MoonctlExpecting(0, {"graph", "import", file, "-a", "rover2"}), HasSubstr("and 1 prior"));
}

TEST_F(G2oFilesTest, FilesOfSeveralRobotsAreOneGraph) {
  MoonctlExpecting(0, {"up"});
  // As distributed-mapper writes them: both robots' files have the edge between the robots.
  const std::string closure = EdgeLine(kSmallA + 2, kSmallB + 1, "0 1 0 0 0 0 1");
  const std::string first = File("0.g2o", RowOf(kSmallA, 4) + closure);
  const std::string second = File("1.g2o", closure + RowOf(kSmallB, 4));
  ExpectRefusal(first, 8, "vertex b1 (id 7061644215716937729) is in no vertex line: give all files of the graph");
  EXPECT_THAT(MoonctlExpecting(0, {"graph", "solve", first, second}), HasSubstr("8 nodes, 7 edges"));
  EXPECT_THAT(MoonctlExpecting(0, {"graph", "import", first, second}),
              HasSubstr("inserted 8 nodes, 6 odometry edges, 0 ranges, 1 loop closures and 0 priors at 2 agents"));
  EXPECT_THAT(MoonctlExpecting(0, {"graph", "import", second, first}),
              HasSubstr("nothing is new: all 8 nodes and 7 edges are stored already"));
  const auto json = MoonctlJson(0, {"graph", "import", first, second});
  EXPECT_EQ(json.fields().at("nodes").number_value(), 0);
  EXPECT_EQ(json.fields().at("stored_already").number_value(), 15);
  EXPECT_EQ(HeldBy("rover1"), (std::array<double, 3>{4, 3, 0})) << "the closure waits for the nodes of rover2";
  MoonctlExpecting(0, {"sync", "now", "--wait"});
  EXPECT_EQ(HeldBy("rover1"), (std::array<double, 3>{8, 6, 1}));
}

TEST_F(G2oFilesTest, NamesTheAgentOfEachLetterIfALetterHasNone) {
  MoonctlExpecting(0, {"up"});
  const Outcome outcome = Moonctl({"graph", "import", File("d.g2o", RowOf(std::uint64_t{'d'} << 56, 2))});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.error, HasSubstr("no agent stands for the letter d"));
  EXPECT_THAT(outcome.error, HasSubstr("A is rover1, B is rover2, C is rover3, L is base"));
}

TEST_F(G2oFilesTest, CountsOnlyNewRecordsAsInserted) {
  MoonctlExpecting(0, {"up"});
  MoonctlExpecting(0, {"graph", "import", File("short.g2o", RowOf(kSmallA, 2))});
  EXPECT_THAT(MoonctlExpecting(0, {"graph", "import", File("long.g2o", RowOf(kSmallA, 4))}),
              HasSubstr("inserted 2 nodes, 2 odometry edges, 0 ranges, 0 loop closures and 0 priors at 1 agents; "
                        "excluded 0; 3 records were stored already"));
}

}  // namespace
}  // namespace moondb
