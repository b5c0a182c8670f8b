#include "actors/pgo/known_graph.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <tuple>
#include <vector>

#include "actors/pgo/pose_graph_solver.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

RecordKey KeyOf(AgentId origin, std::uint64_t seq) { return RecordKey{{origin, 1, proto::POSE_GRAPH_NODE}, seq}; }

// Returns a new key, for tests in which the key does not matter.
RecordKey NextKey() {
  static std::uint64_t seq = 0;
  return KeyOf(1, ++seq);
}

proto::Term TermOf(std::uint64_t number) {
  proto::Term term;
  term.set_number(number);
  return term;
}

proto::Record PoseAt(double x, std::uint64_t term, std::uint64_t run) {
  proto::Record record;
  proto::OptimizedPose& pose = *record.mutable_optimized_pose();
  *pose.mutable_node() = ToProto(NodeKey{1, 2});
  *pose.mutable_map_from_node() = ToProto(Pose::FromPlanar(x, 0, 0));
  *pose.mutable_term() = TermOf(term);
  pose.set_run(run);
  return record;
}

proto::Record VerdictOf(bool is_inlier, std::uint64_t term, std::uint64_t run) {
  proto::Record record;
  proto::EdgeVerdict& verdict = *record.mutable_edge_verdict();
  *verdict.mutable_from() = ToProto(NodeKey{1, 2});
  *verdict.mutable_to() = ToProto(NodeKey{2, 2});
  verdict.set_is_range(true);
  verdict.set_is_inlier(is_inlier);
  *verdict.mutable_term() = TermOf(term);
  verdict.set_run(run);
  return record;
}

// A match of node 2 of agent 1 with node 2 of agent 2, from maps with the timestamps 100 and 200.
proto::Record MatchAt(double x, std::uint64_t term, std::uint64_t run) {
  proto::Record record;
  proto::MapMatch& match = *record.mutable_map_match();
  *match.mutable_from() = ToProto(NodeKey{1, 2});
  *match.mutable_to() = ToProto(NodeKey{2, 2});
  *match.mutable_relative_pose()->mutable_from_from_to() = ToProto(Pose::FromPlanar(x, 0, 0));
  AddUpperTriangle(Matrix6d::Identity(), *match.mutable_relative_pose()->mutable_covariance());
  match.set_from_timestamp_ns(100);
  match.set_to_timestamp_ns(200);
  *match.mutable_term() = TermOf(term);
  match.set_run(run);
  return record;
}

TEST(KnownGraphTest, KeepsTheNewestMapMatchInAnyOrderOfArrival) {
  std::vector<proto::Record> matches = {MatchAt(1, 1, 9), MatchAt(2, 2, 1), MatchAt(3, 2, 2)};
  std::vector<std::size_t> order = {0, 1, 2};
  do {
    KnownGraph known;
    for (const std::size_t i : order) ASSERT_TRUE(known.Add(NextKey(), matches[i]));
    const PoseGraph graph = known.graph();
    ASSERT_EQ(graph.closures.size(), 1u);
    EXPECT_EQ(graph.closures[0].from_from_to.position_m.x(), 3);
    EXPECT_EQ(graph.closures[0].source, kRegistrationSource);
    EXPECT_EQ(known.LastRun(TermOf(2)), 0u) << "the run of a match numbers no solve";
  } while (std::ranges::next_permutation(order).found);
}

TEST(KnownGraphTest, UsesTheGreaterKeyOfTwoMapMatchesOfOneRun) {
  for (const bool is_greater_first : {false, true}) {
    KnownGraph known;
    for (const bool is_greater : {is_greater_first, !is_greater_first}) {
      ASSERT_TRUE(known.Add(KeyOf(1, is_greater ? 4 : 3), MatchAt(is_greater ? 1 : 2, 1, 1)));
    }
    EXPECT_EQ(known.graph().closures[0].from_from_to.position_m.x(), 1);
  }
}

TEST(KnownGraphTest, AMapMatchStandsBesideLoopClosuresOfOtherSources) {
  KnownGraph known;
  ASSERT_TRUE(known.Add(NextKey(), MatchAt(1, 1, 1)));
  ASSERT_TRUE(known.Add(NextKey(), ToRecord(LoopClosure{{1, 2}, {2, 2}, 0, Pose(), Matrix6d::Identity(), "apriltag"})));
  EXPECT_EQ(known.graph().closures.size(), 2u);
}

TEST(KnownGraphTest, LimitsMapMatchesAndCountsThoseLeftOut) {
  KnownGraph known({.nodes_max = 6, .edges_max = 2});
  for (std::uint64_t index = 0; index < 5; ++index) {
    proto::Record match = MatchAt(1, 1, 1);
    match.mutable_map_match()->mutable_to()->set_index(index);
    ASSERT_TRUE(known.Add(KeyOf(3, index + 1), match));
  }
  EXPECT_EQ(known.graph().closures.size(), 2u);
  EXPECT_EQ(known.CountLeftOut(), (std::map<AgentId, std::uint64_t>{{3, 3}}));
  proto::Record newer = MatchAt(7, 2, 1);
  newer.mutable_map_match()->mutable_to()->set_index(0);
  ASSERT_TRUE(known.Add(KeyOf(3, 6), newer));
  EXPECT_EQ(known.graph().closures[0].from_from_to.position_m.x(), 7) << "a match of known ends needs no room";
}

TEST(KnownGraphTest, KeepsTheNewestPoseInAnyOrderOfArrival) {
  for (const bool is_newest_first : {false, true}) {
    KnownGraph known;
    ASSERT_TRUE(known.Add(NextKey(), PoseAt(1, 1, 9)));
    ASSERT_TRUE(known.Add(NextKey(), is_newest_first ? PoseAt(3, 2, 2) : PoseAt(2, 2, 1)));
    ASSERT_TRUE(known.Add(NextKey(), is_newest_first ? PoseAt(2, 2, 1) : PoseAt(3, 2, 2)));
    ASSERT_NE(known.FindPublished({1, 2}), nullptr);
    EXPECT_EQ(known.FindPublished({1, 2})->position_m.x(), 3);
    EXPECT_EQ(known.FindLastSolution().poses.size(), 1u);
  }
}

TEST(KnownGraphTest, KeepsTheNewestVerdict) {
  KnownGraph known;
  const FactorKey range{FactorKind::kRange, {1, 2}, {2, 2}, {}};
  EXPECT_EQ(known.FindVerdict(range), nullptr);
  ASSERT_TRUE(known.Add(NextKey(), VerdictOf(false, 2, 1)));
  ASSERT_TRUE(known.Add(NextKey(), VerdictOf(true, 1, 7)));
  ASSERT_NE(known.FindVerdict(range), nullptr);
  EXPECT_FALSE(known.FindVerdict(range)->is_inlier);
  ASSERT_TRUE(known.Add(NextKey(), VerdictOf(true, 2, 2)));
  EXPECT_TRUE(known.FindVerdict(range)->is_inlier);
}

TEST(KnownGraphTest, KeepsOneVerdictForEachSource) {
  KnownGraph known;
  for (const char* const source : {"apriltag", "slam_toolbox"}) {
    proto::Record record = VerdictOf(std::string(source) == "apriltag", 2, 1);
    record.mutable_edge_verdict()->set_is_range(false);
    record.mutable_edge_verdict()->set_source(source);
    ASSERT_TRUE(known.Add(NextKey(), record));
  }
  const FactorKey accepted{FactorKind::kLoopClosure, {1, 2}, {2, 2}, "apriltag"};
  const FactorKey rejected{FactorKind::kLoopClosure, {1, 2}, {2, 2}, "slam_toolbox"};
  EXPECT_EQ(known.FindLastSolution().accepted, std::set<FactorKey>{accepted});
  EXPECT_EQ(known.FindLastSolution().rejected, std::set<FactorKey>{rejected});
}

TEST(KnownGraphTest, OrdersRunsWithinTheNewestTerm) {
  KnownGraph known;
  EXPECT_EQ(known.LastRun(TermOf(1)), 0u);
  ASSERT_TRUE(known.Add(NextKey(), PoseAt(1, 1, 9)));
  EXPECT_EQ(known.LastRun(TermOf(1)), 9u);
  EXPECT_EQ(known.LastRun(TermOf(2)), 0u);
  ASSERT_TRUE(known.Add(NextKey(), VerdictOf(true, 2, 4)));
  EXPECT_EQ(known.LastRun(TermOf(2)), 4u);
}

TEST(KnownGraphTest, AddsNodesAndEdgesAndRefusesAnInvalidPose) {
  KnownGraph known;
  ASSERT_TRUE(known.Add(NextKey(), ToRecord(GraphNode{{1, 0}, 0, Pose{}})));
  ASSERT_TRUE(known.Add(NextKey(), ToRecord(RangeEdge{{1, 0}, {2, 0}, 0, 3, 0.01})));
  ASSERT_TRUE(known.Add(NextKey(), proto::Record()));
  EXPECT_EQ(known.graph().nodes.size(), 1u);
  EXPECT_EQ(known.graph().ranges.size(), 1u);
  proto::Record damaged = PoseAt(1, 1, 1);
  damaged.mutable_optimized_pose()->mutable_map_from_node()->mutable_orientation()->set_w(9);
  EXPECT_FALSE(known.Add(NextKey(), damaged));
  EXPECT_EQ(known.FindPublished({1, 2}), nullptr);
}

TEST(KnownGraphTest, UsesTheRecordWithTheSmallestKeyInAnyOrderOfArrival) {
  const auto node_at = [](double x) { return ToRecord(GraphNode{{1, 2}, 5, Pose::FromPlanar(x, 0, 0)}); };
  const auto range_of = [](double range_m) { return ToRecord(RangeEdge{{1, 2}, {2, 2}, 5, range_m, 0.01}); };
  const auto step_of = [](double x) {
    return ToRecord(OdometryEdge{{1, 2}, {1, 3}, 5, Pose::FromPlanar(x, 0, 0), Matrix6d::Identity()});
  };
  for (const bool is_smallest_first : {false, true}) {
    KnownGraph known;
    for (const bool is_smallest : {is_smallest_first, !is_smallest_first}) {
      const RecordKey key = is_smallest ? KeyOf(1, 9) : KeyOf(2, 3);
      const double value = is_smallest ? 7 : 8;
      ASSERT_TRUE(known.Add(key, node_at(value)));
      ASSERT_TRUE(known.Add(key, range_of(value)));
      ASSERT_TRUE(known.Add(key, step_of(value)));
    }
    ASSERT_EQ(known.graph().nodes.size(), 1u);
    ASSERT_EQ(known.graph().ranges.size(), 1u);
    ASSERT_EQ(known.graph().odometry.size(), 1u);
    EXPECT_EQ(known.graph().nodes[0].map_from_node.position_m.x(), 7);
    EXPECT_EQ(known.graph().ranges[0].range_m, 7);
    EXPECT_EQ(known.graph().odometry[0].from_from_to.position_m.x(), 7);
  }
}

TEST(KnownGraphTest, IdentifiesAnEdgeByItsEndsAndNotByItsTimestamp) {
  KnownGraph known;
  for (const std::int64_t timestamp_ns : {5, 6}) {
    ASSERT_TRUE(known.Add(NextKey(), ToRecord(RangeEdge{{1, 2}, {2, 2}, timestamp_ns, 3, 0.01})));
    ASSERT_TRUE(known.Add(NextKey(), ToRecord(OdometryEdge{{1, 2}, {1, 3}, timestamp_ns, {}, Matrix6d::Identity()})));
  }
  EXPECT_EQ(known.graph().ranges.size(), 1u);
  EXPECT_EQ(known.graph().odometry.size(), 1u);
}

TEST(KnownGraphTest, UsesTheGreaterKeyOfTwoPosesOfOneRun) {
  for (const bool is_greater_first : {false, true}) {
    KnownGraph known;
    for (const bool is_greater : {is_greater_first, !is_greater_first}) {
      ASSERT_TRUE(known.Add(KeyOf(1, is_greater ? 4 : 3), PoseAt(is_greater ? 1 : 2, 1, 1)));
    }
    EXPECT_EQ(known.FindPublished({1, 2})->position_m.x(), 1);
  }
}

RecordKey EdgeKey(AgentId origin, std::uint64_t seq) { return RecordKey{{origin, 1, proto::POSE_GRAPH_EDGE}, seq}; }

proto::Record StepRecord(AgentId agent, std::uint64_t from, std::uint64_t to) {
  return ToRecord(OdometryEdge{{agent, from}, {agent, to}, 5, Pose::FromPlanar(1, 0, 0), Matrix6d::Identity()});
}

TEST(KnownGraphTest, LimitsAgentsWithTheMostRecordsToTheirNewestNodesAndEdges) {
  KnownGraph known({.nodes_max = 6, .edges_max = 4});
  for (std::uint64_t i = 1; i <= 3; ++i) {
    ASSERT_TRUE(known.Add(KeyOf(1, i), ToRecord(GraphNode{{1, i}, 0, Pose{}})));
    ASSERT_TRUE(known.Add(EdgeKey(1, i), StepRecord(1, i, i + 1)));
  }
  for (std::uint64_t i = 1; i <= 9; ++i) {
    ASSERT_TRUE(known.Add(KeyOf(3, i), ToRecord(GraphNode{{3, i}, 0, Pose{}})));
    ASSERT_TRUE(known.Add(EdgeKey(3, i), StepRecord(3, i, i + 1)));
  }
  const PoseGraph graph = known.graph();
  ASSERT_EQ(graph.nodes.size(), 6u);
  EXPECT_EQ(graph.nodes[2].key, (NodeKey{1, 3}));
  EXPECT_EQ(graph.nodes[3].key, (NodeKey{3, 7}));
  ASSERT_EQ(graph.odometry.size(), 4u);
  EXPECT_EQ(graph.odometry[0].from, (NodeKey{1, 2}));
  EXPECT_EQ(graph.odometry[2].from, (NodeKey{3, 8}));
  EXPECT_EQ(known.CountLeftOut(), (std::map<AgentId, std::uint64_t>{{1, 1}, {3, 6 + 7}}));
}

// Rover 3 has 200 nodes and an odometry edge between every two of them. Rovers 1 and 2 have 20 nodes each. Rover 1
// measured 5 ranges to rover 2.
TEST(KnownGraphTest, LeavesOutEdgesOfAnAgentThatMakeASolveTooLarge) {
  KnownGraph known;
  std::uint64_t seq = 0;
  for (const AgentId agent : {1u, 2u, 3u}) {
    for (std::uint64_t i = 1; i <= (agent == 3 ? 200u : 20u); ++i) {
      ASSERT_TRUE(known.Add(KeyOf(agent, ++seq), ToRecord(GraphNode{{agent, i}, 0, Pose{}})));
      if (i > 1) {
        ASSERT_TRUE(known.Add(EdgeKey(agent, ++seq), StepRecord(agent, i - 1, i)));
      }
    }
  }
  for (std::uint64_t i = 1; i <= 5; ++i) {
    ASSERT_TRUE(known.Add(EdgeKey(1, ++seq), ToRecord(RangeEdge{{1, 2 * i}, {2, 2 * i}, 5, 3, 0.01})));
  }
  for (std::uint64_t to = 1; to <= 200; ++to) {
    for (std::uint64_t from = 1; from + 1 < to; ++from) {
      ASSERT_TRUE(known.Add(EdgeKey(3, ++seq), StepRecord(3, from, to)));
    }
  }
  const std::uint64_t extra_count = 199 * 198 / 2;
  EXPECT_TRUE(known.SelectForSolve({UINT64_MAX, UINT64_MAX}).left_out.empty());
  const SolveSize limit{2'000, UINT64_MAX};
  const KnownGraph::Selection selection = known.SelectForSolve(limit);
  EXPECT_EQ(selection.graph.nodes.size(), 240u);
  EXPECT_EQ(selection.graph.ranges.size(), 5u) << "rover 1 made few edges, and keeps all";
  ASSERT_EQ(selection.left_out.size(), 1u);
  const std::uint64_t kept = extra_count - selection.left_out.at(3);
  EXPECT_EQ(selection.graph.odometry.size(), 19 + 19 + 199 + kept);
  EXPECT_GT(kept, 5u);
  EXPECT_GT(selection.graph.odometry.back().to.index, 150u) << "the newest ones";
}

TEST(KnownGraphTest, ATypicalTeamsGraphFitsIntoTheSizeLimitOfASolve) {
  KnownGraph known;
  std::uint64_t seq = 0;
  for (const AgentId agent : {1u, 2u, 3u}) {
    for (std::uint64_t i = 1; i <= 500; ++i) {
      ASSERT_TRUE(known.Add(KeyOf(agent, ++seq), ToRecord(GraphNode{{agent, i}, 0, Pose{}})));
      if (i > 1) {
        ASSERT_TRUE(known.Add(EdgeKey(agent, ++seq), StepRecord(agent, i - 1, i)));
      }
      const AgentId other = agent % 3 + 1;
      ASSERT_TRUE(known.Add(EdgeKey(agent, ++seq), ToRecord(RangeEdge{{agent, i}, {other, i}, 5, 3, 0.01})));
    }
  }
  EXPECT_TRUE(known.SelectForSolve(KnownGraph::SolveSizeMax(known.node_count())).left_out.empty());
}

TEST(KnownGraphTest, LeavesOutTheOldestNodesThatNothingTies) {
  for (const bool is_reversed : {false, true}) {
    KnownGraph known;
    const std::uint64_t count = KnownGraph::kUntiedNodesMax + 200;
    for (std::uint64_t i = 1; i <= count; ++i) {
      const std::uint64_t seq = is_reversed ? count + 1 - i : i;
      ASSERT_TRUE(known.Add(KeyOf(3, seq), ToRecord(GraphNode{{3, seq}, 0, Pose{}})));
    }
    for (std::uint64_t i = 1; i <= 3; ++i) {
      ASSERT_TRUE(known.Add(KeyOf(1, i), ToRecord(GraphNode{{1, i}, 0, Pose{}})));
    }
    ASSERT_TRUE(known.Add(EdgeKey(1, 4), ToRecord(RangeEdge{{1, 2}, {3, 5}, 5, 3, 0.01})));
    const KnownGraph::Selection selection = known.SelectForSolve({UINT64_MAX, UINT64_MAX});
    EXPECT_EQ(selection.left_out, (std::map<AgentId, std::uint64_t>{{3, 199}}));
    std::vector<std::uint64_t> of_liar;
    for (const GraphNode& node : selection.graph.nodes) {
      if (node.key.agent == 3) of_liar.push_back(node.key.index);
    }
    ASSERT_EQ(of_liar.size(), KnownGraph::kUntiedNodesMax + 1);
    EXPECT_EQ(of_liar[0], 5u) << "a range ties it";
    EXPECT_EQ(of_liar[1], 201u) << "the newest of the others stay";
    EXPECT_EQ(selection.graph.nodes.size(), of_liar.size() + 3);
  }
}

TEST(KnownGraphTest, GivesNoAgentMoreThanItsPart) {
  KnownGraph known({.nodes_max = 40, .edges_max = 40, .agent_count = 4});
  std::uint64_t seq = 0;
  for (std::uint64_t i = 1; i <= 30; ++i) {
    ASSERT_TRUE(known.Add(KeyOf(3, ++seq), ToRecord(GraphNode{{3, i}, 0, Pose{}})));
    if (i > 1) {
      ASSERT_TRUE(known.Add(EdgeKey(3, ++seq), StepRecord(3, i - 1, i)));
    }
  }
  EXPECT_EQ(known.node_count(), 10u);
  EXPECT_EQ(known.graph().odometry.size(), 10u);
  EXPECT_EQ(known.CountLeftOut(), (std::map<AgentId, std::uint64_t>{{3, 20 + 19}}));
}

TEST(KnownGraphTest, ContinuesFromThePublishedPoseOfTheFirstNodeThatIsLeft) {
  KnownGraph known({.nodes_max = 4, .edges_max = 100, .agent_count = 2});
  for (std::uint64_t i = 1; i <= 2; ++i) {
    ASSERT_TRUE(known.Add(KeyOf(1, i), ToRecord(GraphNode{{1, i}, 0, Pose{}})));
  }
  ASSERT_TRUE(known.Add(NextKey(), PoseAt(5, 1, 1)));  // Moves node 2 of agent 1.
  EXPECT_TRUE(known.FindContinuations().empty()) << "nothing was dropped";
  ASSERT_TRUE(known.Add(KeyOf(1, 3), ToRecord(GraphNode{{1, 3}, 0, Pose{}})));
  const std::map<NodeKey, Pose> continuations = known.FindContinuations();
  ASSERT_EQ(continuations.size(), 1u);
  EXPECT_EQ(continuations.begin()->first, (NodeKey{1, 2}));
  EXPECT_EQ(continuations.begin()->second.position_m.x(), 5);
}

TEST(KnownGraphTest, BelievesNoSmallerSigmasThanSensorsHave) {
  KnownGraph known;
  ASSERT_TRUE(known.Add(EdgeKey(3, 1), ToRecord(RangeEdge{{1, 2}, {3, 2}, 5, 3, 1e-8})));
  Matrix6d covariance = Matrix6d::Identity() * 1e-10;
  covariance(0, 0) = 4;
  ASSERT_TRUE(known.Add(EdgeKey(3, 2), ToRecord(LoopClosure{{1, 2}, {3, 2}, 5, Pose(), covariance, "apriltag"})));
  EXPECT_EQ(known.graph().ranges.at(0).variance_m2, 1e-8) << "exports hold what was inserted";
  const PoseGraph graph = known.SelectForSolve({UINT64_MAX, UINT64_MAX}).graph;
  EXPECT_NEAR(graph.ranges.at(0).variance_m2, 0.05 * 0.05, 1e-12);
  EXPECT_EQ(graph.ranges.at(0).producer, 3u);
  const Matrix6d& raised = graph.closures.at(0).covariance;
  EXPECT_NEAR(raised(0, 0), 4, 1e-3);
  EXPECT_NEAR(raised(1, 1), 0.02 * 0.02, 1e-9);
  EXPECT_NEAR(raised(5, 5), 0.002 * 0.002, 1e-9);
  EXPECT_EQ(graph.closures.at(0).producer, 3u);
}

// Drivers of planar robots state huge variances for what they do not measure, and stores hold them.
TEST(KnownGraphTest, UsesVariancesThatClientsMayNotInsertAnyMore) {
  KnownGraph known;
  for (std::uint64_t i = 0; i < 4; ++i) {
    ASSERT_TRUE(known.Add(KeyOf(1, i + 1), ToRecord(GraphNode{{1, i}, 0, Pose::FromPlanar(1.0 * i, 0, 0)})));
  }
  const double unused[] = {1e10, 1e300, 1e-14};
  for (std::uint64_t i = 0; i < 3; ++i) {
    Matrix6d covariance = Matrix6d::Identity() * 0.01;
    covariance(2, 2) = unused[i];
    const OdometryEdge edge{{1, i}, {1, i + 1}, 0, Pose::FromPlanar(1, 0, 0), covariance};
    ASSERT_TRUE(known.Add(EdgeKey(1, i + 1), ToRecord(edge)));
  }
  EXPECT_EQ(known.graph().odometry.at(0).covariance(2, 2), 1e10) << "exports hold what was inserted";
  AgentFactsMap agents;
  agents[1] = AgentFacts{.agent = 1, .start = Pose()};
  const Solution solution = SolvePoseGraph(known.SelectForSolve({UINT64_MAX, UINT64_MAX}).graph, agents, {}, {});
  ASSERT_TRUE(solution.is_accepted) << solution.text;
  EXPECT_TRUE(solution.left_out.empty());
  EXPECT_EQ(solution.odometry_count, 3u);
}

class GraphQuarantinesTest : public testing::Test {
 protected:
  // Makes a quarantine of agent 1.
  static proto::Record Quarantine() {
    proto::Record record;
    record.mutable_map_quarantine()->set_agent_id(1);
    return record;
  }

  static proto::Record QuarantineOfNode(std::uint64_t index) {
    proto::Record record = Quarantine();
    *record.mutable_map_quarantine()->mutable_node() = ToProto(NodeKey{1, index});
    return record;
  }

  static proto::Record LiftOf(const RecordKey& key) {
    proto::Record record;
    *record.mutable_map_quarantine()->mutable_lifts() = ToProto(key);
    return record;
  }

  // Nodes 0 to 3 of agent 1 drive along x, one metre each. The raw pose of node 2 is wrong by 30 km.
  void AddTrajectory() {
    for (std::uint64_t i = 0; i < 4; ++i) {
      const double x = static_cast<double>(i) + (i == 2 ? 30'000 : 0);
      ASSERT_TRUE(known_.Add(NextKey(), ToRecord(GraphNode{{1, i}, 0, Pose::FromPlanar(x, 0, 0)})));
    }
    for (std::uint64_t i = 1; i < 4; ++i) {
      ASSERT_TRUE(known_.Add(
          NextKey(), ToRecord(OdometryEdge{{1, i - 1}, {1, i}, 0, Pose::FromPlanar(1, 0, 0), Matrix6d::Identity()})))
          << i;
    }
  }

  double RawX(std::uint64_t index) {
    for (const GraphNode& node : known_.graph().nodes) {
      if (node.key == NodeKey{1, index}) return node.map_from_node.position_m.x();
    }
    return -1;
  }

  KnownGraph known_;
};

TEST_F(GraphQuarantinesTest, ANodeGetsItsPoseFromOdometry) {
  AddTrajectory();
  EXPECT_EQ(RawX(2), 30'002);
  const RecordKey key = NextKey();
  ASSERT_TRUE(known_.Add(key, QuarantineOfNode(2)));
  EXPECT_NEAR(RawX(2), 2, 1e-9);
  ASSERT_TRUE(known_.Add(NextKey(), QuarantineOfNode(0)));
  EXPECT_NEAR(RawX(0), 0, 1e-9) << "from the node after it";
  EXPECT_EQ(known_.quarantines().size(), 2u);
  ASSERT_TRUE(known_.Add(NextKey(), LiftOf(key)));
  EXPECT_EQ(RawX(2), 30'002);
}

TEST_F(GraphQuarantinesTest, ANodeWithoutOdometryIsLeftOut) {
  ASSERT_TRUE(known_.Add(NextKey(), QuarantineOfNode(7)));
  ASSERT_TRUE(known_.Add(NextKey(), ToRecord(GraphNode{{1, 7}, 0, Pose()})));
  EXPECT_EQ(RawX(7), -1);
}

TEST_F(GraphQuarantinesTest, ANodesOptimizedPoseIsValidIfItIgnoresTheRawPose) {
  ASSERT_TRUE(known_.Add(NextKey(), PoseAt(30'002, 1, 1)));
  ASSERT_TRUE(known_.Add(NextKey(), QuarantineOfNode(2)));
  EXPECT_EQ(known_.FindPublished({1, 2}), nullptr);
  EXPECT_TRUE(known_.FindLastSolution().poses.empty());
  proto::Record better = PoseAt(2, 1, 2);
  better.mutable_optimized_pose()->set_ignores_raw_pose(true);
  ASSERT_TRUE(known_.Add(NextKey(), better));
  ASSERT_NE(known_.FindPublished({1, 2}), nullptr);
  EXPECT_EQ(known_.FindPublished({1, 2})->position_m.x(), 2);
}

TEST_F(GraphQuarantinesTest, LeaveOutFactorsSourcesAndProducersInAnyOrder) {
  const auto count = [](const proto::Record& quarantine, bool is_first) {
    KnownGraph known;
    const auto add = [&known](const proto::Record& record) { ASSERT_TRUE(known.Add(NextKey(), record)); };
    if (is_first) add(quarantine);
    add(ToRecord(RangeEdge{{1, 0}, {2, 3}, 0, 4, 0.01}));
    for (const char* const source : {"apriltag", "slam_toolbox"}) {
      add(ToRecord(LoopClosure{{1, 0}, {2, 3}, 0, Pose(), Matrix6d::Identity(), source}));
    }
    add(ToRecord(
        NodePrior{{1, 0}, 0, PriorExtent::kPose, Pose(), Matrix6d::Identity(), Eigen::Vector3d::Zero(), "gnss"}));
    if (!is_first) add(quarantine);
    const PoseGraph graph = known.graph();
    return std::tuple(graph.ranges.size(), graph.closures.size(), graph.priors.size());
  };
  proto::Record range = Quarantine();
  *range.mutable_map_quarantine()->mutable_factor()->mutable_from() = ToProto(NodeKey{1, 0});
  *range.mutable_map_quarantine()->mutable_factor()->mutable_to() = ToProto(NodeKey{2, 3});
  proto::Record one = range;
  range.mutable_map_quarantine()->mutable_factor()->set_is_range(true);
  one.mutable_map_quarantine()->mutable_factor()->set_source("apriltag");
  proto::Record source = Quarantine();
  source.mutable_map_quarantine()->mutable_producer()->set_source("slam_toolbox");
  proto::Record producer = Quarantine();
  producer.mutable_map_quarantine()->mutable_producer();
  proto::Record another = producer;
  another.mutable_map_quarantine()->set_agent_id(2);
  for (const bool is_first : {false, true}) {
    EXPECT_EQ(count(range, is_first), std::tuple(0u, 2u, 1u));
    EXPECT_EQ(count(one, is_first), std::tuple(1u, 1u, 1u));
    EXPECT_EQ(count(source, is_first), std::tuple(1u, 1u, 1u));
    EXPECT_EQ(count(producer, is_first), std::tuple(0u, 0u, 0u));
    EXPECT_EQ(count(another, is_first), std::tuple(1u, 2u, 1u));
  }
}

// Quarantines that leave out the match of MatchAt, and quarantines beside it.
TEST_F(GraphQuarantinesTest, LeaveOutMapMatchesUntilTheyAreLifted) {
  const auto of_maps = [](AgentId agent, std::int64_t from_ns, std::int64_t to_ns) {
    proto::Record record = Quarantine();
    record.mutable_map_quarantine()->set_agent_id(agent);
    record.mutable_map_quarantine()->set_from_ns(from_ns);
    record.mutable_map_quarantine()->set_to_ns(to_ns);
    return record;
  };
  const auto of_producer = [](AgentId agent, const std::string& source) {
    proto::Record record = Quarantine();
    record.mutable_map_quarantine()->set_agent_id(agent);
    record.mutable_map_quarantine()->mutable_producer()->set_source(source);
    return record;
  };
  proto::Record factor = Quarantine();
  *factor.mutable_map_quarantine()->mutable_factor()->mutable_from() = ToProto(NodeKey{1, 2});
  *factor.mutable_map_quarantine()->mutable_factor()->mutable_to() = ToProto(NodeKey{2, 2});
  factor.mutable_map_quarantine()->mutable_factor()->set_source("registration");
  proto::Record other_factor = factor;
  other_factor.mutable_map_quarantine()->mutable_factor()->set_source("apriltag");
  // Agent 3 led and inserted the match.
  const std::vector<std::pair<proto::Record, bool>> cases = {
      {of_maps(1, 90, 100), true},
      {of_maps(2, 200, 210), true},
      {of_maps(1, 101, 300), false},
      {of_maps(2, 100, 199), false},
      {of_maps(3, 0, 1000), false},
      {QuarantineOfNode(2), true},
      {QuarantineOfNode(3), false},
      {factor, true},
      {other_factor, false},
      {of_producer(3, "registration"), true},
      {of_producer(3, ""), true},
      {of_producer(3, "apriltag"), false},
      {of_producer(1, "registration"), false},
  };
  for (const auto& [quarantine, is_left_out] : cases) {
    for (const bool is_first : {false, true}) {
      KnownGraph known;
      const RecordKey key = NextKey();
      if (is_first) {
        ASSERT_TRUE(known.Add(key, quarantine));
      }
      ASSERT_TRUE(known.Add(KeyOf(3, 1), MatchAt(1, 1, 1)));
      EXPECT_EQ(known.graph().closures.size(), is_first && is_left_out ? 0u : 1u) << quarantine.ShortDebugString();
      if (!is_first) {
        ASSERT_TRUE(known.Add(key, quarantine));
      }
      EXPECT_EQ(known.graph().closures.size(), is_left_out ? 0u : 1u) << quarantine.ShortDebugString();
      ASSERT_TRUE(known.Add(NextKey(), LiftOf(key)));
      EXPECT_EQ(known.graph().closures.size(), 1u) << quarantine.ShortDebugString();
    }
  }
}

TEST_F(GraphQuarantinesTest, CountOnlyPartsOfTheGraph) {
  ASSERT_TRUE(known_.Add(NextKey(), Quarantine()));
  EXPECT_EQ(known_.quarantines().size(), 0u);
  ASSERT_TRUE(known_.Add(NextKey(), QuarantineOfNode(2)));
  EXPECT_EQ(known_.quarantines().size(), 1u);
}

}  // namespace
}  // namespace moondb
