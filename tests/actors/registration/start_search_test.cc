// Tests the search for rovers that started anywhere in generated worlds: what is placed, what is not, and why.
#include "actors/registration/start_search.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "model/pose_graph.h"
#include "proto/types.pb.h"
#include "tests/actors/registration/hazard_world.h"

namespace moondb {
namespace {

using Accepted = std::vector<StartSearch::Accepted>;

// A drive from point to point, with a node each metre.
std::vector<PlanarOffset> Along(const std::vector<Eigen::Vector2d>& corners_m) {
  std::vector<PlanarOffset> poses;
  for (std::size_t i = 0; i + 1 < corners_m.size(); ++i) {
    const Eigen::Vector2d leg_m = corners_m[i + 1] - corners_m[i];
    const double yaw_rad = std::atan2(leg_m.y(), leg_m.x());
    for (double at_m = 0; at_m < leg_m.norm(); at_m += 1) {
      const Eigen::Vector2d place_m = corners_m[i] + at_m * leg_m.normalized();
      poses.push_back({place_m.x(), place_m.y(), yaw_rad});
    }
  }
  return poses;
}

class StartSearchTest : public testing::Test {
 protected:
  StartSearchTest() : maps_(Options()) {}

  static KnownMaps::Options Options() {
    KnownMaps::Options options;
    options.rovers = {1, 2, 3};
    return options;
  }

  // Drives rover `agent` along true poses in a world. Its own frame lies at `own_from_map` of the true one. Each second
  // node has a map.
  void Drive(AgentId agent, const HazardWorld& world, const std::vector<PlanarOffset>& poses,
             const Pose& own_from_map) {
    std::mt19937_64 random(agent);
    std::normal_distribution<double> error(0, 1);
    PlanarOffset raw = PlanarOffset::From(own_from_map) * poses.front();
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const NodeKey node{agent, i};
      if (i > 0) {
        const PlanarOffset step = poses[i - 1].Inverse() * poses[i];
        raw = raw * PlanarOffset{step.x_m + 0.01 * error(random), step.y_m + 0.01 * error(random),
                                 step.yaw_rad + 0.003 * error(random)};
        OdometryEdge edge;
        edge.from = {agent, i - 1};
        edge.to = node;
        edge.covariance.diagonal() << 1e-4, 1e-4, 1e-4, 1e-4, 1e-4, 1e-5;
        Add(agent, proto::POSE_GRAPH_EDGE, ToRecord(edge));
      }
      const std::int64_t timestamp_ns = 1'000'000'000'000 * agent + static_cast<std::int64_t>(i) * 1'000'000'000;
      Add(agent, proto::POSE_GRAPH_NODE, ToRecord(GraphNode{node, timestamp_ns, raw.ToPose()}));
      proto::Record solved;
      *solved.mutable_optimized_pose()->mutable_node() = ToProto(node);
      *solved.mutable_optimized_pose()->mutable_map_from_node() = ToProto(raw.ToPose());
      Add(1, proto::OPTIMIZED_POSE, solved);
      truth_[node] = poses[i];
      if (i % 2 == 0) AddMap(node, world, poses[i], timestamp_ns);
    }
  }

  void AddMap(const NodeKey& node, const HazardWorld& world, const PlanarOffset& pose, std::int64_t timestamp_ns) {
    const TraversabilityMap map = world.MapAt(pose.ToPose(), node);
    proto::Record record;
    record.set_timestamp_ns(timestamp_ns);
    *record.mutable_local_traversability_map() = ToProto(map);
    Add(node.agent, proto::LOCAL_TRAVERSABILITY_MAP, record);
  }

  void Add(AgentId origin, DataType type, const proto::Record& record) {
    EXPECT_TRUE(maps_.Add({{origin, 7, type}, ++seq_}, record));
  }

  Accepted Search(const std::vector<StartSearch::AgentPair>& wanted) {
    std::map<AgentId, StartSearch::Rover> rovers;
    for (const RegisteredMap& map : maps_.FindRegistered()) rovers[map.node.agent].maps.push_back(map);
    for (auto& [agent, rover] : rovers) rover.track = maps_.FindTrack(agent);
    search_.Begin(rovers, wanted);
    Accepted accepted;
    for (step_count_ = 0; search_.left_count() > 0; ++step_count_) {
      for (StartSearch::Accepted& one : search_.Step(maps_, fields_)) accepted.push_back(std::move(one));
    }
    return accepted;
  }

  void ExpectRight(const Accepted& accepted) {
    EXPECT_GE(accepted.size(), StartSearch::kMapPairsMin);
    for (const auto& [planned, result] : accepted) {
      const PlanarOffset truth = truth_.at(planned.first.node).Inverse() * truth_.at(planned.second.node);
      const PlanarOffset error = truth.Inverse() * result.first_from_second;
      EXPECT_LT(error.position_m().norm(), 0.15);
      EXPECT_LT(std::abs(error.yaw_rad), 0.03);
    }
  }

  StartVerdict Verdict(AgentId a = 1, AgentId b = 2) const { return search_.judged().at({a, b}).verdict; }

  KnownMaps maps_;
  FieldCache fields_ = FieldCache(64);
  StartSearch search_;
  std::map<NodeKey, PlanarOffset> truth_;
  std::uint64_t seq_ = 0;
  int step_count_ = 0;
};

const std::vector<PlanarOffset>& Loop() {
  static const auto poses = Along({{-12, -10}, {12, -10}, {12, 10}, {-12, 10}});
  return poses;
}
const std::vector<PlanarOffset>& Back() {
  static const auto poses = Along({{10, 12}, {10, -9}, {-10, -9}});
  return poses;
}

TEST_F(StartSearchTest, PlacesARoverThatStartedAnywhereInAnyHeading) {
  const HazardWorld world = HazardWorld::OfRooms(1);
  Drive(1, world, Loop(), Pose());
  Drive(2, world, Back(), Pose::FromPlanar(100, -40, 2.3));
  ExpectRight(Search({{1, 2}}));
  EXPECT_EQ(Verdict(), StartVerdict::kAccepted);
  EXPECT_GE(search_.judged().at({1, 2}).best.evidence, 12);
}

TEST_F(StartSearchTest, RemembersWhatItMatchedAndMatchesNewSubmapsOnly) {
  const HazardWorld world = HazardWorld::OfRooms(1);
  Drive(1, world, Loop(), Pose());
  Drive(2, world, Back(), Pose::FromPlanar(100, -40, 2.3));
  const Accepted first = Search({{1, 2}});
  EXPECT_GT(step_count_, 20);
  EXPECT_TRUE(Search({{1, 2}}).empty());
  EXPECT_EQ(step_count_, 0) << "nothing is new";
  EXPECT_TRUE(Search({}).empty());
  const Accepted again = Search({{1, 2}});
  EXPECT_TRUE(again.empty() || again.size() == first.size());
}

TEST_F(StartSearchTest, GivesTheSameResultForTheSameRecords) {
  const HazardWorld world = HazardWorld::OfRooms(1);
  Drive(1, world, Loop(), Pose());
  Drive(2, world, Back(), Pose::FromPlanar(100, -40, 2.3));
  const Accepted one = Search({{1, 2}});
  search_.Clear();
  const Accepted other = Search({{1, 2}});
  ASSERT_EQ(one.size(), other.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].first.first.key, other[i].first.first.key);
    EXPECT_EQ(one[i].second.first_from_second.x_m, other[i].second.first_from_second.x_m);
  }
}

TEST_F(StartSearchTest, DoesNotPlaceARoverInAnotherBuilding) {
  Drive(1, HazardWorld::OfRooms(1), Loop(), Pose());
  Drive(2, HazardWorld::OfRooms(2), Back(), Pose());
  EXPECT_TRUE(Search({{1, 2}}).empty());
  EXPECT_NE(Verdict(), StartVerdict::kAccepted);
}

TEST_F(StartSearchTest, DoesNotPlaceARoverInACorridor) {
  HazardWorld world;
  world.walls = {{{-60, 1.5}, {60, 1.5}}, {{-60, -1.5}, {60, -1.5}}};
  Drive(1, world, Along({{-40, 0}, {0, 0}}), Pose());
  Drive(2, world, Along({{10, 0.3}, {-30, 0.3}}), Pose::FromPlanar(3, 4, 1));
  EXPECT_TRUE(Search({{1, 2}}).empty());
  EXPECT_NE(Verdict(), StartVerdict::kAccepted);
}

TEST_F(StartSearchTest, DoesNotPlaceARoverAmongEqualPillars) {
  HazardWorld world;
  for (int x = -6; x <= 6; ++x) {
    for (int y = -6; y <= 6; ++y) world.rocks.push_back({{4.0 * x, 4.0 * y}, 0.3});
  }
  Drive(1, world, Along({{-10, -6}, {10, -6}, {10, 6}}), Pose());
  Drive(2, world, Along({{8, 2}, {-12, 2}, {-12, -10}}), Pose::FromPlanar(30, 4, 0.7));
  EXPECT_TRUE(Search({{1, 2}}).empty());
  EXPECT_NE(Verdict(), StartVerdict::kAccepted);
}

TEST_F(StartSearchTest, DoesNotPlaceARoverThatTurnsOnOneSpot) {
  const HazardWorld world = HazardWorld::OfRooms(1);
  Drive(1, world, Loop(), Pose());
  std::vector<PlanarOffset> poses;
  for (int i = 0; i < 40; ++i) poses.push_back({3, -10, WrappedAngle(0.3 * i)});
  Drive(2, world, poses, Pose::FromPlanar(30, 4, 0.7));
  EXPECT_TRUE(Search({{1, 2}}).empty());
  EXPECT_EQ(Verdict(), StartVerdict::kFewSubmaps);
}

TEST_F(StartSearchTest, DoesNotPlaceARoverWhoseMapsAreNoise) {
  Drive(1, HazardWorld::OfRooms(1), Loop(), Pose());
  Drive(2, HazardWorld::OfRocks(3, 400, 44), Back(), Pose());
  EXPECT_TRUE(Search({{1, 2}}).empty());
  EXPECT_NE(Verdict(), StartVerdict::kAccepted);
}

TEST_F(StartSearchTest, DoesNotPlaceARoverWhoseBuildingHasTwoEqualHalves) {
  // Two copies of one building beside each other: the second rover may be in either.
  HazardWorld half = HazardWorld::OfRooms(5, 30);
  HazardWorld world = half;
  for (const Wall& wall : half.walls)
    world.walls.push_back({wall.from_m + Eigen::Vector2d(60, 0), wall.to_m + Eigen::Vector2d(60, 0)});
  for (const Rock& rock : half.rocks) world.rocks.push_back({rock.center_m + Eigen::Vector2d(60, 0), rock.radius_m});
  Drive(1, world, Along({{-10, -8}, {10, -8}, {10, 8}, {70, 8}, {70, -8}, {50, -8}}), Pose());
  Drive(2, world, Along({{8, -9}, {-8, -9}, {-8, 9}}), Pose::FromPlanar(10, 4, 0.7));
  EXPECT_TRUE(Search({{1, 2}}).empty());
  EXPECT_NE(Verdict(), StartVerdict::kAccepted);
}

TEST_F(StartSearchTest, ARoverWhoseOdometryJumpsIsPlacedByItsLongestUnbrokenPart) {
  const HazardWorld world = HazardWorld::OfRooms(1);
  Drive(1, world, Loop(), Pose());
  std::vector<PlanarOffset> poses = Back();
  Drive(2, world, poses, Pose::FromPlanar(100, -40, 2.3));
  // The robot's software starts again: further nodes without an edge, elsewhere in its frame.
  const NodeKey node{2, poses.size()};
  Add(2, proto::POSE_GRAPH_NODE, ToRecord(GraphNode{node, 3'000'000'000'000, Pose::FromPlanar(-500, 0, 0)}));
  truth_[node] = {0, 0, 0};
  ExpectRight(Search({{1, 2}}));
}

TEST_F(StartSearchTest, SearchesAmongRoversOfWhichNoneIsPlacedAndKeepsPairsApart) {
  const HazardWorld world = HazardWorld::OfRooms(1);
  Drive(1, world, Loop(), Pose());
  Drive(2, world, Back(), Pose::FromPlanar(100, -40, 2.3));
  Drive(3, HazardWorld::OfRooms(2), Back(), Pose());
  const Accepted accepted = Search({{1, 2}, {1, 3}, {2, 3}});
  ExpectRight(accepted);
  for (const auto& [planned, result] : accepted) EXPECT_EQ(planned.second.node.agent, 2u);
  EXPECT_EQ(Verdict(1, 2), StartVerdict::kAccepted);
  EXPECT_NE(Verdict(1, 3), StartVerdict::kAccepted);
  EXPECT_NE(Verdict(2, 3), StartVerdict::kAccepted);
}

}  // namespace
}  // namespace moondb
