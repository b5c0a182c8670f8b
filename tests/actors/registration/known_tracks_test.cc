#include "actors/registration/known_tracks.h"

#include <gtest/gtest.h>

#include "model/pose_graph.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

class KnownTracksTest : public testing::Test {
 protected:
  void AddNode(std::uint64_t index, double x_m) {
    const GraphNode node{{1, index}, 1, Pose::FromPlanar(x_m, 0, 0)};
    tracks_.Add({{1, 7, proto::POSE_GRAPH_NODE}, ++seq_}, ToRecord(node));
  }
  void AddEdge(std::uint64_t to) {
    OdometryEdge edge;
    edge.from = {1, to - 1};
    edge.to = {1, to};
    edge.covariance = 0.01 * Matrix6d::Identity();
    tracks_.Add({{1, 7, proto::POSE_GRAPH_EDGE}, ++seq_}, ToRecord(edge));
  }
  std::size_t Length() const {
    const auto track = tracks_.FindTrack(1);
    return track ? track->size() : 0;
  }

  KnownTracks tracks_ = KnownTracks(100);
  std::uint64_t seq_ = 0;
};

TEST_F(KnownTracksTest, JoinNodesThatOdometryJoins) {
  EXPECT_EQ(tracks_.FindTrack(1), nullptr);
  for (std::uint64_t i = 0; i < 5; ++i) {
    AddNode(i, static_cast<double>(i));
    if (i > 0) AddEdge(i);
  }
  ASSERT_EQ(Length(), 5u);
  EXPECT_NEAR(tracks_.FindTrack(1)->CovarianceOf(0, 4, {4, 0})(2, 2), 0.04, 1e-12);
  EXPECT_EQ(tracks_.FindTrack(2), nullptr);
}

TEST_F(KnownTracksTest, BreakWhereAnEdgeOrANodeIsMissingAndAtAJump) {
  for (std::uint64_t i = 0; i < 10; ++i) {
    AddNode(i, i < 6 ? static_cast<double>(i) : 100.0 + static_cast<double>(i));  // Jumps before node 6.
    if (i > 0 && i != 2) AddEdge(i);
  }
  EXPECT_EQ(Length(), 4u);
  EXPECT_EQ(tracks_.FindTrack(1)->node(0).index, 6u) << "the newest of the longest parts: 2 to 5, 6 to 9";
  AddNode(12, 112);
  AddEdge(12);
  EXPECT_EQ(Length(), 4u) << "nodes 10 and 11 are missing";
}

TEST_F(KnownTracksTest, KeepTheNewestNodesIfThereAreTooMany) {
  for (std::uint64_t i = 0; i < 150; ++i) {
    AddNode(i, static_cast<double>(i));
    if (i > 0) AddEdge(i);
  }
  ASSERT_EQ(Length(), 100u);
  EXPECT_EQ(tracks_.FindTrack(1)->node(99).index, 149u);
  std::map<AgentId, std::uint64_t> left_out;
  tracks_.CountLeftOut(left_out);
  EXPECT_EQ(left_out.at(1), 50u + 49u);
}

}  // namespace
}  // namespace moondb
