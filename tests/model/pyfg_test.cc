#include "model/pyfg.h"

#include <gmock/gmock.h>

#include <cmath>
#include <cstdlib>

namespace moondb {
namespace {

using testing::EndsWith;
using testing::HasSubstr;

constexpr const char* kSpatial =
    "# a comment\n"
    "VERTEX_SE3:QUAT 1671300425.3106995 A0 0.1 -2e-3 3 0 0 0 1\n"
    "\n"
    "VERTEX_SE3:QUAT 10 A1 1.1 0 0 0 0 0.7071067811865476 0.7071067811865476\r\n"
    "VERTEX_XYZ L0 5 6 7\n"
    "EDGE_SE3:QUAT 10 A0 A1 1 0 0 0 0 0.6 0.8 2 0 0 0 0 0.1 2 0 0 0 0 2 0 0 0 3 0 0 3 0 3\n"
    "EDGE_RANGE 10 A1 L0 7.25 0.01\n";

std::string FieldOf(const std::string& text) {
  const Result<Pyfg> pyfg = ParsePyfg(text, "graph.pyfg");
  return pyfg ? "no error" : pyfg.error().field;
}

std::string TextOf(const std::string& text) {
  const Result<Pyfg> pyfg = ParsePyfg(text, "graph.pyfg");
  return pyfg ? "no error" : pyfg.error().text;
}

// Returns kSpatial with `line` added as line 8.
std::string WithLine(const std::string& line) { return kSpatial + line + "\n"; }

void ExpectSameGraph(const Pyfg& a, const Pyfg& b) {
  ASSERT_EQ(a.graph.nodes.size(), b.graph.nodes.size());
  for (std::size_t i = 0; i < a.graph.nodes.size(); ++i) {
    const GraphNode& x = a.graph.nodes[i];
    const GraphNode& y = b.graph.nodes[i];
    ASSERT_EQ(x.key, y.key);
    ASSERT_EQ(x.timestamp_ns, y.timestamp_ns);
    ASSERT_EQ(x.map_from_node.position_m, y.map_from_node.position_m);
    ASSERT_EQ(x.map_from_node.orientation.coeffs(), y.map_from_node.orientation.coeffs());
  }
  ASSERT_EQ(a.graph.odometry.size(), b.graph.odometry.size());
  for (std::size_t i = 0; i < a.graph.odometry.size(); ++i) {
    ASSERT_EQ(a.graph.odometry[i].covariance, b.graph.odometry[i].covariance);
    ASSERT_EQ(a.graph.odometry[i].from_from_to.position_m, b.graph.odometry[i].from_from_to.position_m);
    ASSERT_EQ(a.graph.odometry[i].from_from_to.orientation.coeffs(),
              b.graph.odometry[i].from_from_to.orientation.coeffs());
  }
  ASSERT_EQ(a.graph.ranges.size(), b.graph.ranges.size());
  for (std::size_t i = 0; i < a.graph.ranges.size(); ++i) {
    ASSERT_EQ(a.graph.ranges[i].range_m, b.graph.ranges[i].range_m);
    ASSERT_EQ(a.graph.ranges[i].timestamp_ns, b.graph.ranges[i].timestamp_ns);
  }
  ASSERT_EQ(a.landmarks.size(), b.landmarks.size());
  ASSERT_EQ(a.sightings.size(), b.sightings.size());
}

TEST(PyfgTest, ReadsEveryFieldOfASpatialGraph) {
  const Result<Pyfg> pyfg = ParsePyfg(kSpatial, "graph.pyfg");
  ASSERT_TRUE(pyfg) << ToString(pyfg.error());
  EXPECT_FALSE(pyfg->is_planar);
  ASSERT_EQ(pyfg->graph.nodes.size(), 2u);
  EXPECT_EQ(pyfg->graph.nodes[0].timestamp_ns, 1671300425310699500);
  EXPECT_EQ(pyfg->graph.nodes[0].key, (NodeKey{1, 0}));
  EXPECT_EQ(pyfg->graph.nodes[0].map_from_node.position_m, Eigen::Vector3d(0.1, -0.002, 3));
  EXPECT_NEAR(pyfg->graph.nodes[1].map_from_node.Yaw(), std::acos(-1) / 2, 1e-12);
  ASSERT_EQ(pyfg->landmarks.size(), 1u);
  EXPECT_EQ(pyfg->landmarks[0].key, (NodeKey{AgentOfLetter('L'), 0}));
  EXPECT_FALSE(pyfg->landmarks[0].timestamp_ns);
  const OdometryEdge& edge = pyfg->graph.odometry.at(0);
  EXPECT_EQ(edge.covariance(0, 0), 2);
  EXPECT_EQ(edge.covariance(0, 5), 0.1);
  EXPECT_EQ(edge.covariance(5, 0), 0.1);
  EXPECT_EQ(edge.covariance(5, 5), 3);
  EXPECT_EQ(edge.from_from_to.orientation.w(), 0.8);
  EXPECT_EQ(pyfg->graph.ranges.at(0).range_m, 7.25);
  EXPECT_EQ(pyfg->graph.ranges.at(0).variance_m2, 0.01);
}

TEST(PyfgTest, PlacesAPlanarGraphInThePlane) {
  const Result<Pyfg> pyfg = ParsePyfg(
      "VERTEX_SE2 0 A0 1 2 0.5\nVERTEX_SE2 1 A1 2 2 0.5\nVERTEX_XY 5.5 L3 3 4\n"
      "EDGE_SE2 1 A0 A1 1 0 0.25 4 0.5 0.25 9 0.125 16\nEDGE_SE2_XY 1 A1 L3 1 2 4 0 9\n",
      "graph.pyfg");
  ASSERT_TRUE(pyfg) << ToString(pyfg.error());
  EXPECT_TRUE(pyfg->is_planar);
  EXPECT_EQ(pyfg->landmarks.at(0).timestamp_ns, 5'500'000'000);
  const Matrix6d& covariance = pyfg->graph.odometry.at(0).covariance;
  EXPECT_EQ(covariance(0, 5), 0.25);
  EXPECT_EQ(covariance(1, 5), 0.125);
  EXPECT_EQ(covariance(5, 5), 16);
  EXPECT_EQ(covariance(2, 2), 1);
  EXPECT_EQ(pyfg->sightings.at(0).covariance(1, 1), 9);
}

TEST(PyfgTest, WritesWhatReadsBackBitForBit) {
  Pyfg pyfg;
  const Pose turned{Eigen::Vector3d(0.1 + 0.2, -1.0 / 3, 1e-17), Eigen::Quaterniond(0.3, 0.5, -0.7, 0.1).normalized()};
  pyfg.graph.nodes = {{{1, 0}, -1, turned}, {{27, 18446744073709551615u}, 1671300425310699513, turned}};
  pyfg.graph.odometry = {{{1, 0}, {27, 18446744073709551615u}, 7, turned, Matrix6d::Identity() / 3}};
  pyfg.landmarks = {{{12, 0}, std::nullopt, {1, 2, 1.0 / 7}}};
  pyfg.graph.ranges = {{{1, 0}, {12, 0}, 10'000'000'000, 1.1, 0.1}};
  pyfg.sightings = {{{1, 0}, {12, 0}, 3, {1, 2, 3}, Eigen::Matrix3d::Identity() / 7}};
  const Result<Pyfg> read = ParsePyfg(FormatPyfg(pyfg), "graph.pyfg");
  ASSERT_TRUE(read) << ToString(read.error());
  ExpectSameGraph(pyfg, *read);
  EXPECT_EQ(read->landmarks[0].position_m, pyfg.landmarks[0].position_m);
  EXPECT_EQ(read->sightings[0].covariance, pyfg.sightings[0].covariance);
  EXPECT_EQ(FormatPyfg(*read), FormatPyfg(pyfg));
}

TEST(PyfgTest, WritesPriorsThatReadBackBitForBit) {
  Pyfg pyfg;
  const Pose turned{Eigen::Vector3d(0.1, -1.0 / 3, 2), Eigen::Quaterniond(0.3, 0.5, -0.7, 0.1).normalized()};
  pyfg.graph.nodes = {{{1, 0}, 0, turned}};
  pyfg.landmarks = {{{12, 0}, std::nullopt, {1, 2, 3}}};
  const Matrix6d covariance = Matrix6d::Identity() / 3;
  NodePrior of_pose{{1, 0}, 5, PriorExtent::kPose, turned, covariance, Eigen::Vector3d::Zero(), {}};
  NodePrior of_landmark{{12, 0}, 6, PriorExtent::kPosition, Pose{{1, 2, 1.0 / 7}, {}}, {}, Eigen::Vector3d::Zero(), {}};
  of_landmark.map_from_node.orientation.setIdentity();
  of_landmark.covariance = Matrix6d::Identity();
  of_landmark.covariance(0, 1) = of_landmark.covariance(1, 0) = 0.125;
  pyfg.graph.priors = {of_pose, of_landmark};
  const Result<Pyfg> read = ParsePyfg(FormatPyfg(pyfg), "graph.pyfg");
  ASSERT_TRUE(read) << ToString(read.error());
  ASSERT_EQ(read->graph.priors.size(), 2u);
  EXPECT_EQ(read->graph.priors[0].covariance, covariance);
  EXPECT_EQ(read->graph.priors[0].map_from_node.orientation.coeffs(), turned.orientation.coeffs());
  EXPECT_EQ(read->graph.priors[1].extent, PriorExtent::kPosition);
  EXPECT_EQ(read->graph.priors[1].covariance(0, 1), 0.125);
  EXPECT_EQ(FormatPyfg(*read), FormatPyfg(pyfg));
}

TEST(PyfgTest, ReadsPlanarPriorsOfPosesAndLandmarks) {
  const Result<Pyfg> pyfg = ParsePyfg(
      "VERTEX_SE2 0 A0 1 2 0.5\nVERTEX_XY L0 3 4\nVERTEX_SE2:PRIOR 0 A0 1 2 0.5 4 0.5 0.25 9 0.125 16\n"
      "VERTEX_XY:PRIOR 1 L0 3 4 0.2 0 0.2\nVERTEX_XY:PRIOR 1 A0 3 4 0.2 0 0.2\n",
      "graph.pyfg");
  ASSERT_TRUE(pyfg) << ToString(pyfg.error());
  ASSERT_EQ(pyfg->graph.priors.size(), 3u);
  const NodePrior& pose = pyfg->graph.priors[0];
  EXPECT_EQ(pose.extent, PriorExtent::kPositionYaw);
  EXPECT_EQ(pose.covariance(3, 3), 16);
  EXPECT_EQ(pose.covariance(0, 3), 0.25);
  EXPECT_EQ(pose.covariance(2, 2), 1);
  EXPECT_EQ(pyfg->graph.priors[1].node, (NodeKey{12, 0}));
  EXPECT_EQ(FieldOf("VERTEX_XY L0 3 4\nVERTEX_SE2:PRIOR 0 L0 1 2 0.5 4 0 0 9 0 16\n"), "graph.pyfg:2");
  EXPECT_EQ(FieldOf("VERTEX_XY L0 3 4\nVERTEX_XY:PRIOR 0 L1 1 2 4 0 9\n"), "graph.pyfg:2");
}

TEST(PyfgTest, AgentsAndLettersAreInverse) {
  for (AgentId agent = 1; agent <= 52; ++agent) EXPECT_EQ(AgentOfLetter(LetterOfAgent(agent)), agent);
  EXPECT_EQ(AgentOfLetter('A'), 1u);
  EXPECT_EQ(AgentOfLetter('z'), 52u);
  EXPECT_EQ(AgentOfLetter('7'), 0u);
  EXPECT_EQ(LetterOfAgent(53), '?');
}

TEST(PyfgTest, NamesTheLineOfATruncatedFile) {
  const std::string whole = kSpatial;
  EXPECT_EQ(FieldOf(whole.substr(0, whole.size() - 6)), "graph.pyfg:7");
  EXPECT_EQ(TextOf(whole.substr(0, whole.size() - 6)), "the line ends too early");
}

TEST(PyfgTest, NamesTheLineOfEachMistake) {
  EXPECT_EQ(FieldOf(kSpatial), "no error");
  const std::pair<const char*, const char*> cases[] = {
      {"VERTEX_SE3:QUAT 1 A2 nan 0 0 0 0 0 1", "finite"},
      {"VERTEX_SE3:QUAT 1 A2 inf 0 0 0 0 0 1", "finite"},
      {"VERTEX_SE3:QUAT 1 A2 1e999 0 0 0 0 0 1", "finite"},
      {"VERTEX_SE3:QUAT 1 A2 0x 0 0 0 0 0 1", "finite"},
      {"VERTEX_SE3:QUAT 1 A2 2e9 0 0 0 0 0 1", "1e9"},
      {"VERTEX_SE3:QUAT 1 A2 0 0 0 0 0 0 0", "length 0"},
      {"VERTEX_SE3:QUAT 1 A2 0 0 0 0 0 0 1 9", "too many"},
      {"VERTEX_SE3:QUAT 1 A1 0 0 0 0 0 0 1", "A1 occurs a second time"},
      {"VERTEX_XYZ L0 0 0 0", "L0 occurs a second time"},
      {"VERTEX_SE3:QUAT x A2 0 0 0 0 0 0 1", "stamp"},
      {"VERTEX_SE3:QUAT 1 22 0 0 0 0 0 0 1", "key"},
      {"VERTEX_SE3:QUAT 1 A 0 0 0 0 0 0 1", "key"},
      {"VERTEX_SE3:QUAT 1 A-1 0 0 0 0 0 0 1", "key"},
      {"VERTEX_SE3 1 A2 0 0 0 0 0 0 1", "not a keyword"},
      {"VERTEX_SE2 1 A2 0 0 0", "mixed"},
      {"EDGE_RANGE 1 A0 A9 1 1", "no vertex has the key A9"},
      {"EDGE_RANGE 1 A0 A0 1 1", "with itself"},
      {"EDGE_RANGE 1 A0 A1 -1 1", "range must"},
      {"EDGE_RANGE 1 A0 A1 1 0", "variance"},
      {"EDGE_RANGE 1 A0 A1 1 -0.5", "variance"},
      {"EDGE_SE3:QUAT 10 A0 L0 1 0 0 0 0 0 1 2 0 0 0 0 0 2 0 0 0 0 2 0 0 0 3 0 0 3 0 3", "L0 is a landmark"},
      {"EDGE_SE3:QUAT 10 A0 A1 1 0 0 0 0 0 1 -2 0 0 0 0 0 2 0 0 0 0 2 0 0 0 3 0 0 3 0 3", "positive definite"},
      {"EDGE_SE3_XYZ 10 A0 A1 1 0 0 1 0 0 1 0 1", "A1 is not a landmark"},
  };
  for (const auto& [line, expected] : cases) {
    SCOPED_TRACE(line);
    EXPECT_EQ(FieldOf(WithLine(line)), "graph.pyfg:8");
    EXPECT_THAT(TextOf(WithLine(line)), HasSubstr(expected));
  }
  EXPECT_EQ(FieldOf(WithLine(std::string(5000, 'x'))), "graph.pyfg:8");
}

TEST(PyfgTest, FindsVerticesBehindTheirEdges) {
  EXPECT_EQ(FieldOf("EDGE_RANGE 0 A0 B0 1 1\nVERTEX_SE2 0 A0 0 0 0\nVERTEX_SE2 0 B0 1 0 0\n"), "no error");
  EXPECT_EQ(FieldOf("EDGE_RANGE 0 A0 B0 1 1\nVERTEX_SE2 0 A0 0 0 0\n"), "graph.pyfg:1");
}

TEST(PyfgTest, SaysThatAFileIsMissing) {
  const Result<Pyfg> pyfg = ReadPyfg("/nowhere/graph.pyfg");
  ASSERT_FALSE(pyfg);
  EXPECT_EQ(pyfg.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(pyfg.error().field, EndsWith("graph.pyfg"));
}

TEST(PyfgTest, ReadsPublicGraphs) {
  const char* data = std::getenv("MOONDB_DATA");
  if (data == nullptr) GTEST_SKIP() << "MOONDB_DATA is not set";
  struct Case {
    const char* name;
    std::size_t nodes, landmarks, odometry, sightings, ranges;
  };
  const Case cases[] = {{"factor_graph_small.pyfg", 6, 1, 5, 0, 5},
                        {"mrclam5a.pyfg", 1080, 15, 1075, 1127, 316},
                        {"tiers.pyfg", 9768, 1, 9764, 0, 7789}};
  for (const Case& c : cases) {
    SCOPED_TRACE(c.name);
    const Result<Pyfg> pyfg = ReadPyfg(std::filesystem::path(data) / "pose_graphs" / c.name);
    ASSERT_TRUE(pyfg) << ToString(pyfg.error());
    EXPECT_TRUE(pyfg->is_planar);
    EXPECT_EQ(pyfg->graph.nodes.size(), c.nodes);
    EXPECT_EQ(pyfg->landmarks.size(), c.landmarks);
    EXPECT_EQ(pyfg->graph.odometry.size(), c.odometry);
    EXPECT_EQ(pyfg->sightings.size(), c.sightings);
    EXPECT_EQ(pyfg->graph.ranges.size(), c.ranges);
    const Result<Pyfg> again = ParsePyfg(FormatPyfg(*pyfg), "again");
    ASSERT_TRUE(again) << ToString(again.error());
    ExpectSameGraph(*pyfg, *again);
  }
}

}  // namespace
}  // namespace moondb
