#include "actors/registration/start_search.h"

#include <gtest/gtest.h>

#include <numbers>

#include "proto/types.pb.h"

namespace moondb {
namespace {

RegisteredMap MapAt(AgentId agent, std::uint64_t index, double x_m) {
  RegisteredMap map;
  map.key = {{agent, 1, proto::LOCAL_TRAVERSABILITY_MAP}, index + 1};
  map.node = {agent, index};
  map.map_from_node = map.map_from_local = Pose::FromPlanar(x_m, 0, 0);
  return map;
}

// Returns a match that places rover 2 at `start`, off by `error_m`.
StartSearch::Accepted MatchOf(std::uint64_t first, std::uint64_t second, const Pose& start, double error_m = 0,
                              double matched = 0.9) {
  const RegisteredMap a = MapAt(1, first, 3.0 * static_cast<double>(first));
  const RegisteredMap b = MapAt(2, second, 2.0 * static_cast<double>(second));
  MatchResult result;
  result.verdict = MatchVerdict::kAccepted;
  result.matched = matched;
  result.first_from_second =
      PlanarOffset::From(a.map_from_local.Inverse() * Pose::FromPlanar(error_m, 0, 0) * start * b.map_from_local);
  return {{a, b, {}, {5, std::numbers::pi}}, result};
}

class StartSearchTest : public testing::Test {
 protected:
  void Note(const StartSearch::Accepted& match) { search_.Note(match.first, match.second); }

  StartSearch search_;
  const Pose start_ = Pose::FromPlanar(12, -5, 2.5);
};

TEST_F(StartSearchTest, TwoMatchesThatShareNoMapAndAgreePlaceARover) {
  Note(MatchOf(0, 0, start_));
  EXPECT_TRUE(search_.FindAgreeing(2).empty());
  Note(MatchOf(1, 1, start_, 0.25));
  EXPECT_EQ(search_.FindAgreeing(2).size(), 2u);
  EXPECT_TRUE(search_.FindAgreeing(3).empty());
}

TEST_F(StartSearchTest, MatchesOfOneMapAreNotIndependent) {
  Note(MatchOf(0, 0, start_));
  Note(MatchOf(1, 0, start_));
  EXPECT_TRUE(search_.FindAgreeing(2).empty());
}

TEST_F(StartSearchTest, MatchesThatDisagreePlaceNothing) {
  Note(MatchOf(0, 0, start_));
  Note(MatchOf(1, 1, start_, 0.6));
  EXPECT_TRUE(search_.FindAgreeing(2).empty());
  Note(MatchOf(2, 2, start_ * Pose::FromPlanar(0, 0, 0.1)));
  EXPECT_TRUE(search_.FindAgreeing(2).empty());
}

TEST_F(StartSearchTest, AThirdOfTheAgreeingMatchesMayContradict) {
  Note(MatchOf(0, 0, start_));
  Note(MatchOf(1, 1, start_));
  Note(MatchOf(2, 2, Pose::FromPlanar(-30, 1, 0)));
  EXPECT_TRUE(search_.FindAgreeing(2).empty());
  Note(MatchOf(3, 3, start_));
  EXPECT_EQ(search_.FindAgreeing(2).size(), 3u);
}

TEST_F(StartSearchTest, PoorMatchesDoNotCount) {
  Note(MatchOf(0, 0, start_, 0, 0.79));
  Note(MatchOf(1, 1, start_, 0, 0.79));
  EXPECT_TRUE(search_.FindAgreeing(2).empty());
}

TEST_F(StartSearchTest, PlansEachPairOfARoverThatIsNotPlacedOnce) {
  std::vector<RegisteredMap> maps;
  for (std::uint64_t i = 0; i < 1000; ++i) maps.push_back(MapAt(1, i, 3.0 * static_cast<double>(i)));
  for (std::uint64_t i = 0; i < 100; ++i) maps.push_back(MapAt(2, i, 2.0 * static_cast<double>(i)));
  EXPECT_TRUE(search_.Plan(maps, {1, 2}).empty());
  EXPECT_TRUE(search_.Plan(maps, {}).empty());
  const std::vector<PlannedMatch> planned = search_.Plan(maps, {1});
  EXPECT_LE(planned.size(), StartSearch::kRoverMapsMax * StartSearch::kOtherMapsMax);
  EXPECT_GE(planned.size(), 1000u);
  for (const PlannedMatch& pair : planned) {
    EXPECT_EQ(pair.first.node.agent, 1u);
    EXPECT_EQ(pair.second.node.agent, 2u);
    search_.Note(pair, {});
  }
  EXPECT_TRUE(search_.Plan(maps, {1}).empty());
  search_.Clear();
  EXPECT_EQ(search_.Plan(maps, {1}).size(), planned.size());
}

}  // namespace
}  // namespace moondb
