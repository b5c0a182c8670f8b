#include "apps/moondb_ros/odometry_track.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/apps/moondb_ros/ros_fixtures.h"

namespace moondb {
namespace {

TEST(OdometryTrackTest, InterpolatesBetweenMessages) {
  OdometryTrack track;
  ASSERT_TRUE(track.Add(OdometryAt(0, Pose::FromPlanar(1, 0, 0))));
  ASSERT_TRUE(track.Add(OdometryAt(0.1, Pose::FromPlanar(1.2, 0.1, 0.2))));
  const std::optional<Pose> pose = track.PoseAt(At(0.05));
  ASSERT_TRUE(pose);
  EXPECT_NEAR(pose->position_m.x(), 1.1, 1e-6);
  EXPECT_NEAR(pose->position_m.y(), 0.05, 1e-6);
  EXPECT_NEAR(pose->Yaw(), 0.1, 1e-6);
  EXPECT_FALSE(track.PoseAt(At(-0.01)));
  EXPECT_FALSE(track.PoseAt(At(0.11)));
}

TEST(OdometryTrackTest, KeepsTenSeconds) {
  OdometryTrack track;
  Drive(track, 0, 30);
  EXPECT_TRUE(track.PoseAt(At(20.5)));
  EXPECT_FALSE(track.PoseAt(At(19)));
}

TEST(OdometryTrackTest, DropsPosesThatAreNone) {
  OdometryTrack track;
  ASSERT_TRUE(track.Add(OdometryAt(0, Pose())));
  Pose bad;
  bad.position_m.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(track.Add(OdometryAt(1, bad)));
  bad.position_m.x() = 1e308;
  EXPECT_FALSE(track.Add(OdometryAt(1, bad)));
  bad = Pose();
  bad.orientation.coeffs() *= 0;
  EXPECT_FALSE(track.Add(OdometryAt(1, bad)));
  bad.orientation.coeffs() = {0, 0, 0, 1.02};
  EXPECT_FALSE(track.Add(OdometryAt(1, bad)));
  bad.orientation.coeffs() = {0, 0, 0, 1.005};
  EXPECT_TRUE(track.Add(OdometryAt(1, bad)));
  EXPECT_NEAR(track.PoseAt(At(1))->orientation.norm(), 1, 1e-12);
}

TEST(OdometryTrackTest, DropsTimestampsThatDoNotRise) {
  OdometryTrack track;
  ASSERT_TRUE(track.Add(OdometryAt(1, Pose())));
  EXPECT_FALSE(track.Add(OdometryAt(1, Pose())));
  EXPECT_FALSE(track.Add(OdometryAt(0, Pose())));
}

TEST(OdometryTrackTest, BeginsAgainAfterATimestampInTheFuture) {
  OdometryTrack track;
  Drive(track, 0, 2);
  ASSERT_TRUE(track.Add(OdometryAt(3600, Pose::FromPlanar(2, 0, 0))));
  int dropped_count = 0;
  double seconds = 2.05;
  while (!track.Add(OdometryAt(seconds, Pose::FromPlanar(seconds, 0, 0)))) {
    seconds += 0.05;
    ASSERT_LT(++dropped_count, 200);
  }
  EXPECT_EQ(dropped_count, 99);
  EXPECT_EQ(track.newest_ns(), At(seconds));
  EXPECT_EQ(track.JumpsUntil(At(seconds)), 1u);
  EXPECT_TRUE(track.Add(OdometryAt(seconds + 0.05, Pose::FromPlanar(seconds, 0, 0))));
}

TEST(OdometryTrackTest, DropsOtherFrames) {
  OdometryTrack track;
  ASSERT_TRUE(track.Add(OdometryAt(0, Pose())));
  const Result<void> other = track.Add({At(1), "robot2/odom", "base_link", Pose()});
  ASSERT_FALSE(other);
  EXPECT_NE(other.error().text.find("robot2/odom"), std::string::npos);
  EXPECT_NE(other.error().text.find("only one program may publish this topic"), std::string::npos);
}

TEST(OdometryTrackTest, StandsStillOverAJump) {
  OdometryTrack track;
  Drive(track, 0, 2);
  ASSERT_TRUE(track.Add(OdometryAt(2.05, Pose::FromPlanar(0, 0, 1.5))));
  EXPECT_EQ(track.JumpsUntil(At(2)), 0u);
  EXPECT_EQ(track.JumpsUntil(At(2.05)), 1u);
  EXPECT_NEAR(track.PoseAt(At(2.05))->position_m.x(), 2, 1e-9);
  // One metre ahead from there, in the direction in which the robot stood.
  ASSERT_TRUE(track.Add(OdometryAt(3.05, Pose::FromPlanar(std::cos(1.5), std::sin(1.5), 1.5))));
  EXPECT_NEAR(track.PoseAt(At(3.05))->position_m.x(), 3, 1e-9);
  EXPECT_NEAR((track.track_from_odom() * Pose::FromPlanar(0, 0, 1.5)).position_m.x(), 2, 1e-9);
}

TEST(OdometryTrackTest, CountsALongGapAsOneSecond) {
  OdometryTrack track;
  ASSERT_TRUE(track.Add(OdometryAt(0, Pose())));
  ASSERT_TRUE(track.Add(OdometryAt(60, Pose::FromPlanar(4.9, 0, 0))));
  EXPECT_EQ(track.JumpsUntil(At(60)), 0u);
  ASSERT_TRUE(track.Add(OdometryAt(120, Pose::FromPlanar(11, 0, 0))));
  EXPECT_EQ(track.JumpsUntil(At(120)), 1u);
}

TEST(OdometryTrackTest, TakesTimestampsAFewMillisecondsApart) {
  OdometryTrack track;
  ASSERT_TRUE(track.Add(OdometryAt(0, Pose())));
  ASSERT_TRUE(track.Add(OdometryAt(0.001, Pose::FromPlanar(0.04, 0, 0))));
  EXPECT_EQ(track.JumpsUntil(At(0.001)), 0u);
}

}  // namespace
}  // namespace moondb
