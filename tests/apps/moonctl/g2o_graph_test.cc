#include "apps/moonctl/g2o_graph.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

Pyfg TwoRovers() {
  const auto pyfg = ParsePyfg(
      "VERTEX_SE3:QUAT 0 A0 1 2 3 0 0 0 1\n"
      "VERTEX_SE3:QUAT 0 A1 2 2 3 0 0 0 1\n"
      "VERTEX_SE3:QUAT 0 B7 5 5 0 0 0 1 0\n"
      "EDGE_SE3:QUAT 0 A0 A1 1 0 0 0 0 0 1 4 0 0 0 0 0 4 0 0 0 0 4 0 0 0 0.25 0 0 0.25 0 0.25\n"
      "EDGE_RANGE 0 A1 B7 4 0.01\n",
      "test");
  EXPECT_TRUE(pyfg.has_value());
  return *pyfg;
}

TEST(G2oGraphTest, NamesVerticesByTheLetterAndTheNumberAndComesBack) {
  const Pyfg pyfg = TwoRovers();
  const Result<G2o> g2o = ToG2o(pyfg);
  ASSERT_TRUE(g2o.has_value()) << ToString(g2o.error());
  ASSERT_EQ(g2o->vertices.size(), 3u);
  EXPECT_EQ(g2o->vertices[0].id, std::uint64_t{'A'} << 56);
  EXPECT_EQ(g2o->vertices[2].id, (std::uint64_t{'B'} << 56) + 7);
  ASSERT_EQ(g2o->edges.size(), 1u);
  EXPECT_EQ(g2o->edges[0].information(0, 0), 0.25);
  EXPECT_EQ(g2o->edges[0].information(5, 5), 4);

  const Result<Pyfg> back = ToPyfg(*g2o, /*plain_agent=*/0);
  ASSERT_TRUE(back.has_value()) << ToString(back.error());
  ASSERT_EQ(back->graph.nodes.size(), 3u);
  EXPECT_EQ(back->graph.nodes[2].key, (NodeKey{2, 7}));
  ASSERT_EQ(back->graph.odometry.size(), 1u);
  EXPECT_EQ(back->graph.odometry[0].to, (NodeKey{1, 1}));
  EXPECT_EQ(back->graph.odometry[0].covariance, pyfg.graph.odometry[0].covariance);
  EXPECT_TRUE(back->graph.ranges.empty());
}

TEST(G2oGraphTest, ConvertsLoopClosuresBetweenRobotsAndPriors) {
  Pyfg pyfg;
  const Pose turned{Eigen::Vector3d(1, 2, 3), Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5)};
  pyfg.graph.nodes = {{{1, 0}, 0, turned}, {{2, 4}, 0, turned}};
  pyfg.graph.closures = {{{1, 0}, {2, 4}, 0, turned, Matrix6d::Identity(), "apriltag"}};
  NodePrior prior;
  prior.node = {2, 4};
  prior.map_from_node = turned;
  prior.covariance.diagonal() << 1, 2, 3, 4, 5, 6;
  pyfg.graph.priors = {prior};
  const Result<G2o> g2o = ToG2o(pyfg);
  ASSERT_TRUE(g2o) << ToString(g2o.error());
  EXPECT_EQ(g2o->edges.size(), 1u);
  ASSERT_EQ(g2o->priors.size(), 1u);
  // This rotation maps the body's x, y, z axes to the map's z, -x and -y axes. g2o's information is in the body's
  // frame.
  EXPECT_NEAR(g2o->priors[0].information(0, 0), 1.0 / 3, 1e-12);
  EXPECT_NEAR(g2o->priors[0].information(1, 1), 1, 1e-12);
  EXPECT_NEAR(g2o->priors[0].information(2, 2), 1.0 / 2, 1e-12);
  const Result<Pyfg> back = ToPyfg(*g2o, 0);
  ASSERT_TRUE(back) << ToString(back.error());
  EXPECT_TRUE(back->graph.priors.at(0).covariance.isApprox(prior.covariance, 1e-12));
}

TEST(G2oGraphTest, GivesPlainIdsToTheRoverThatIsNamed) {
  const auto g2o = ParseG2o("VERTEX_SE2 3 1 2 0\nVERTEX_SE2 4 2 2 0\nEDGE_SE2 3 4 1 0 0 1 0 0 1 0 1\n", "test");
  ASSERT_TRUE(g2o.has_value());
  const Result<Pyfg> nobodys = ToPyfg(*g2o, 0);
  ASSERT_FALSE(nobodys.has_value());
  EXPECT_EQ(nobodys.error().text, "vertex 3 names no robot: name one with -a");
  EXPECT_EQ(nobodys.error().field, "test:1");
  const Result<Pyfg> pyfg = ToPyfg(*g2o, 2);
  ASSERT_TRUE(pyfg.has_value());
  EXPECT_EQ(pyfg->graph.nodes[1].key, (NodeKey{2, 4}));
  EXPECT_TRUE(pyfg->is_planar);
}

TEST(G2oGraphTest, RefusesTwoIdsOfOneNode) {
  // LabeledSymbols of the robot A: a pose x and a landmark l with one index.
  const std::uint64_t pose = std::uint64_t{'x'} << 56 | std::uint64_t{'A'} << 48;
  const std::uint64_t landmark = std::uint64_t{'l'} << 56 | std::uint64_t{'A'} << 48;
  const auto g2o = ParseG2o(
      "VERTEX_SE2 " + std::to_string(pose) + " 0 0 0\nVERTEX_SE2 " + std::to_string(landmark) + " 0 0 0\n", "test");
  ASSERT_TRUE(g2o.has_value());
  const Result<Pyfg> pyfg = ToPyfg(*g2o, 0);
  ASSERT_FALSE(pyfg.has_value());
  EXPECT_EQ(pyfg.error().field, "test:2");
  EXPECT_EQ(pyfg.error().text,
            "the vertices " + std::to_string(pose) + " and " + std::to_string(landmark) + " are both node A0");
}

TEST(G2oGraphTest, RefusesUnnameableVerticesAndSingularMatrices) {
  Pyfg pyfg = TwoRovers();
  pyfg.graph.nodes[0].key.index = std::uint64_t{1} << 48;
  EXPECT_EQ(ToG2o(pyfg).error().code, ErrorCode::kInvalid);
  pyfg = TwoRovers();
  pyfg.graph.odometry[0].covariance.setZero();
  EXPECT_EQ(ToG2o(pyfg).error().code, ErrorCode::kInvalid);
  const auto without_vertices = ParseG2o("EDGE_SE2 3 4 1 0 0 1 0 0 1 0 1\n", "test");
  ASSERT_TRUE(without_vertices.has_value());
  EXPECT_EQ(ToPyfg(*without_vertices, 1).error().code, ErrorCode::kInvalid);
}

}  // namespace
}  // namespace moondb
