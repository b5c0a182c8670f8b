#include "model/start_poses.h"

#include <gmock/gmock.h>

namespace moondb {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;

proto::TeamConfig TeamWithStarts(const std::vector<double>& xs) {
  proto::TeamConfig team;
  for (const double side_m : {0.75, 0.5}) team.mutable_map()->add_footprint_m(side_m);
  for (std::size_t i = 0; i < xs.size(); ++i) {
    proto::AgentConfig& agent = *team.add_agents();
    agent.set_id(static_cast<std::uint32_t>(i + 1));
    agent.mutable_start()->set_x(xs[i]);
  }
  return team;
}

TEST(StartPosesTest, CountsStartsThatLieApart) {
  const proto::TeamConfig team = TeamWithStarts({0, 0.8, 1.6});
  EXPECT_THAT(KnownStarts(team), ElementsAre(1, 2, 3));
  EXPECT_THAT(CoincidingStarts(team), IsEmpty());
}

TEST(StartPosesTest, CountsOnlyTheLowestOfStartsInOnePlace) {
  const proto::TeamConfig team = TeamWithStarts({0, 0, 0, 5});
  EXPECT_THAT(KnownStarts(team), ElementsAre(1, 4));
  EXPECT_THAT(CoincidingStarts(team), ElementsAre(Pair(2, 1), Pair(3, 1)));
}

TEST(StartPosesTest, ComparesWithStartsThatCount) {
  const proto::TeamConfig team = TeamWithStarts({0, 0.5, 1.0});
  EXPECT_THAT(KnownStarts(team), ElementsAre(1, 3)) << "the start of 2 does not count, so it makes no other doubtful";
}

TEST(StartPosesTest, LeavesOutRoversWithoutAStart) {
  proto::TeamConfig team = TeamWithStarts({0, 3});
  team.mutable_agents(0)->clear_start();
  EXPECT_THAT(KnownStarts(team), ElementsAre(2));
}

}  // namespace
}  // namespace moondb
