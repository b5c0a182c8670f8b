#include "model/leases.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace moondb {
namespace {

using std::chrono::seconds;

constexpr Leases::Time kStart{std::chrono::hours(5)};

proto::AgentLease Lease(AgentId agent, double driving_s, double sleeping_s, double paused_s = 0) {
  proto::AgentLease lease;
  lease.set_agent_id(agent);
  lease.set_driving_s(driving_s);
  lease.set_sleeping_s(sleeping_s);
  lease.set_paused_s(paused_s);
  return lease;
}

TEST(LeasesTest, CountsDownAndExpires) {
  Leases leases(/*is_quiet_while_driving=*/true);
  EXPECT_TRUE(leases.Left(kStart).leases().empty());
  EXPECT_FALSE(leases.NextExpiry(kStart));
  leases.Set(Lease(2, 40, 0), kStart);
  leases.Set(Lease(3, 10, 60), kStart);
  EXPECT_EQ(leases.NextExpiry(kStart), kStart + seconds(10));
  EXPECT_EQ(leases.LeftOf(2, kStart + seconds(15)).driving_s(), 25);
  EXPECT_EQ(leases.LeftOf(3, kStart + seconds(15)).driving_s(), 0);
  EXPECT_EQ(leases.Left(kStart + seconds(15)).leases_size(), 2);
  EXPECT_EQ(leases.NextExpiry(kStart + seconds(15)), kStart + seconds(40));
  EXPECT_EQ(leases.Left(kStart + seconds(40)).leases_size(), 1);
  EXPECT_TRUE(leases.Left(kStart + seconds(60)).leases().empty());
  EXPECT_FALSE(leases.NextExpiry(kStart + seconds(60)));
}

TEST(LeasesTest, WindowIsOpenWhenNeitherEndDrivesOrSleeps) {
  Leases leases(/*is_quiet_while_driving=*/true);
  leases.Set(Lease(2, 40, 0), kStart);
  leases.Set(Lease(3, 0, 60), kStart);
  EXPECT_FALSE(leases.IsOpen(1, 2, kStart));
  EXPECT_FALSE(leases.IsOpen(2, 1, kStart));
  EXPECT_FALSE(leases.IsOpen(1, 3, kStart));
  EXPECT_TRUE(leases.IsOpen(1, 4, kStart));
  EXPECT_TRUE(leases.IsOpen(1, 2, kStart + seconds(40)));
  EXPECT_FALSE(leases.IsOpen(2, 3, kStart + seconds(40)));
  leases.SetAll(proto::LeasesChanged());
  EXPECT_TRUE(leases.IsOpen(2, 3, kStart));
}

TEST(LeasesTest, ATeamThatTalksWhileDrivingIsQuietForSleepersOnly) {
  Leases leases(/*is_quiet_while_driving=*/false);
  leases.Set(Lease(2, 40, 0), kStart);
  leases.Set(Lease(3, 0, 60), kStart);
  EXPECT_TRUE(leases.IsOpen(1, 2, kStart));
  EXPECT_FALSE(leases.IsOpen(1, 3, kStart));
}

TEST(LeasesTest, APauseShutsTheWindowInAnyTeamAndIsNoSilence) {
  for (const bool is_quiet_while_driving : {true, false}) {
    Leases leases(is_quiet_while_driving);
    leases.Set(Lease(2, 0, 0, 40), kStart);
    leases.Set(Lease(3, 50, 0, 0), kStart);
    leases.Set(Lease(4, 0, 50, 0), kStart);
    EXPECT_FALSE(leases.IsOpen(1, 2, kStart));
    EXPECT_FALSE(leases.MayBeSilent(2, kStart));
    EXPECT_EQ(leases.MayBeSilent(3, kStart), is_quiet_while_driving);
    EXPECT_TRUE(leases.MayBeSilent(4, kStart));
    EXPECT_EQ(leases.LeftOf(2, kStart + seconds(15)).paused_s(), 25);
    EXPECT_EQ(leases.NextExpiry(kStart), kStart + seconds(40));
    EXPECT_EQ(leases.Left(kStart + seconds(39)).leases_size(), 3);
    EXPECT_EQ(leases.Left(kStart + seconds(40)).leases_size(), 2);
    EXPECT_TRUE(leases.IsOpen(1, 2, kStart + seconds(40)));
  }
}

TEST(LeasesTest, ChecksSeconds) {
  for (const double good : {0., 0.5, 86400.}) EXPECT_TRUE(CheckLeaseSeconds(good, "seconds")) << good;
  for (const double bad : {-0.1, 86400.1, std::nan(""), std::numeric_limits<double>::infinity()}) {
    const auto checked = CheckLeaseSeconds(bad, "seconds");
    ASSERT_FALSE(checked) << bad;
    EXPECT_EQ(ToString(checked.error()), "seconds: expected 0 to 86400 seconds") << bad;
  }
}

TEST(LeasesTest, DescribesEachAgentsLease) {
  EXPECT_EQ(ToString(Lease(2, 39.2, 0)), "drives for 40 s more");
  EXPECT_EQ(ToString(Lease(2, 0, 3600)), "sleeps for 3600 s more");
  EXPECT_EQ(ToString(Lease(2, 5, 7)), "drives for 5 s and sleeps for 7 s more");
  EXPECT_EQ(ToString(Lease(2, 0, 0, 40)), "is paused for 40 s more");
  EXPECT_EQ(ToString(Lease(2, 5, 0, 40)), "drives for 5 s and is paused for 40 s more");
  EXPECT_EQ(ToString(Lease(2, 0, 0)), "");
}

}  // namespace
}  // namespace moondb
