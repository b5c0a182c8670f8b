#include "apps/moondb_sim/prune_checker.h"

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

TEST(PruneCheckerTest, AllowsRecordsThatLeaderAndSurvivorHeld) {
  PruneChecker checker(3);
  checker.OnRoles(Roles());
  checker.OnAnswer(1, Held({1, 9}));
  checker.OnAnswer(2, Dropped({3, 12}));
  checker.OnPruneRequest();
  EXPECT_FALSE(checker.OnHave(Dropped({3, 9})));
  EXPECT_TRUE(checker.OnHave(Dropped({2, 9})));
  EXPECT_TRUE(checker.OnHave(Dropped({3, 10})));
}

TEST(PruneCheckerTest, AsksNotTheAgentItself) {
  PruneChecker checker(1);
  checker.OnRoles(Roles());
  checker.OnAnswer(2, Held({1, 9}));
  checker.OnPruneRequest();
  EXPECT_FALSE(checker.OnHave(Dropped({1, 9})));
}

TEST(PruneCheckerTest, AllowsNothingIfAnAgentDidNotAnswer) {
  PruneChecker checker(3);
  checker.OnRoles(Roles());
  checker.OnAnswer(1, Held({1, 9}));
  checker.OnPruneRequest();
  EXPECT_TRUE(checker.OnHave(Dropped({1, 1})));
}

TEST(PruneCheckerTest, IgnoresSupersededRecords) {
  const PruneChecker checker(3);
  HaveSet have;
  have[{3, 5, proto::POWER}].dropped.Add(7);
  have[kMaps].held.Add(1);
  EXPECT_FALSE(checker.OnHave(have));
}

}  // namespace
}  // namespace moondb::simulation
