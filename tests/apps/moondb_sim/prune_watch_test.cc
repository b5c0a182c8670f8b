#include "apps/moondb_sim/prune_watch.h"

#include <gtest/gtest.h>

#include "proto/term.pb.h"
#include "proto/types.pb.h"

namespace moondb::simulation {
namespace {

const StreamKey kMaps{3, 5, proto::LOCAL_TRAVERSABILITY_MAP};

HaveSet Held(IntervalSet::Interval interval) {
  HaveSet have;
  have[kMaps].held.Add(interval);
  return have;
}

HaveSet Dropped(IntervalSet::Interval interval) {
  HaveSet have;
  have[kMaps].dropped.Add(interval);
  return have;
}

proto::RoleAssignment Roles() {
  proto::RoleAssignment roles;
  roles.set_leader(1);
  roles.set_survivor(2);
  return roles;
}

TEST(PruneWatchTest, AllowsWhatLeaderAndSurvivorHad) {
  PruneWatch watch(3);
  watch.OnRoles(Roles());
  watch.OnAnswer(1, Held({1, 9}));
  watch.OnAnswer(2, Dropped({3, 12}));
  watch.OnPruneRequest();
  EXPECT_FALSE(watch.OnHave(Dropped({3, 9})));
  EXPECT_TRUE(watch.OnHave(Dropped({2, 9})));
  EXPECT_TRUE(watch.OnHave(Dropped({3, 10})));
}

TEST(PruneWatchTest, AsksNotTheAgentItself) {
  PruneWatch watch(1);
  watch.OnRoles(Roles());
  watch.OnAnswer(2, Held({1, 9}));
  watch.OnPruneRequest();
  EXPECT_FALSE(watch.OnHave(Dropped({1, 9})));
}

TEST(PruneWatchTest, AllowsNothingWhereOneDidNotAnswer) {
  PruneWatch watch(3);
  watch.OnRoles(Roles());
  watch.OnAnswer(1, Held({1, 9}));
  watch.OnPruneRequest();
  EXPECT_TRUE(watch.OnHave(Dropped({1, 1})));
}

TEST(PruneWatchTest, LooksAtNothingThatIsSuperseded) {
  const PruneWatch watch(3);
  HaveSet have;
  have[{3, 5, proto::POWER}].dropped.Add(7);
  have[kMaps].held.Add(1);
  EXPECT_FALSE(watch.OnHave(have));
}

}  // namespace
}  // namespace moondb::simulation
