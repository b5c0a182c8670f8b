// Tests the search for rovers that started anywhere in generated worlds: what is placed, what is not, and why.
#include "actors/registration/start_search.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/actors/registration/driven_rovers.h"

namespace moondb {
namespace {

using Accepted = std::vector<StartSearch::Accepted>;

class StartSearchTest : public DrivenRovers {
 protected:
  Accepted Search(const std::vector<StartSearch::AgentPair>& wanted) {
    std::map<AgentId, SearchedRover> rovers;
    const std::vector<RegisteredMap> maps = maps_.FindRegistered();
    for (const auto& [a, b] : wanted) {
      for (const AgentId agent : {a, b}) rovers.emplace(agent, SearchedRover::Find(agent, maps, maps_).value());
    }
    search_.Begin(std::move(rovers), wanted);
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

  FieldCache fields_ = FieldCache(64);
  StartSearch search_;
  int step_count_ = 0;
};

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

TEST_F(StartSearchTest, ARoverWhoseMapsAreCopiesOfAnothersTiesOnlyItself) {
  const HazardWorld world = HazardWorld::OfRooms(1);
  Drive(1, world, Loop(), Pose());
  Drive(2, HazardWorld::OfRooms(2), Back(), Pose::FromPlanar(20, 0, 1));
  // Rover 3 claims to have driven 50 m beside rover 1, and sends rover 1's maps as its own.
  Drive(3, world, Loop(), Pose::FromPlanar(50, 0, 0));
  const Accepted accepted = Search({{1, 2}, {1, 3}, {2, 3}});
  EXPECT_FALSE(accepted.empty());
  for (const auto& [planned, result] : accepted) {
    EXPECT_EQ(planned.first.node.agent, 1u);
    EXPECT_EQ(planned.second.node.agent, 3u);
  }
  EXPECT_NE(Verdict(1, 2), StartVerdict::kAccepted);
  EXPECT_NE(Verdict(2, 3), StartVerdict::kAccepted);
}

TEST_F(StartSearchTest, DoesNotPlaceARoverInABuildingOfTheSameOutline) {
  // Long straight walls that meet at right angles fit everywhere.
  int placed = 0;
  for (std::uint64_t seed = 10; seed < 14; ++seed) {
    SCOPED_TRACE(seed);
    maps_ = KnownMaps(Options());
    search_.Clear();
    Drive(1, HazardWorld::OfRooms(seed, 30, 0.004), Along({{-11, -11}, {11, -11}, {11, 11}, {-11, 11}}), Pose());
    Drive(2, HazardWorld::OfRooms(seed + 100, 30, 0.004), Along({{11, 10}, {11, -11}, {-11, -11}}),
          Pose::FromPlanar(9, 4, 2));
    EXPECT_TRUE(Search({{1, 2}}).empty());
    placed += Verdict() == StartVerdict::kAccepted ? 1 : 0;
    EXPECT_LT(search_.judged().at({1, 2}).best.evidence, 12);
  }
  EXPECT_EQ(placed, 0);
}

TEST_F(StartSearchTest, MapsThatAreGoneOrQuarantinedDuringTheSearchDoNotEndIt) {
  const HazardWorld world = HazardWorld::OfRooms(1);
  Drive(1, world, Loop(), Pose());
  Drive(2, world, Back(), Pose::FromPlanar(100, -40, 2.3));
  std::map<AgentId, SearchedRover> rovers;
  const std::vector<RegisteredMap> maps = maps_.FindRegistered();
  for (const AgentId agent : {1, 2}) rovers.emplace(agent, SearchedRover::Find(agent, maps, maps_).value());
  search_.Begin(std::move(rovers), {{1, 2}});
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(search_.Step(maps_, fields_).empty());
  const KnownMaps nothing(Options());
  while (search_.left_count() > 0) EXPECT_TRUE(search_.Step(nothing, fields_).empty());
  EXPECT_NE(Verdict(), StartVerdict::kAccepted);
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
