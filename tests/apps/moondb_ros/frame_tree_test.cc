#include "apps/moondb_ros/frame_tree.h"

#include <gtest/gtest.h>

#include "tests/apps/moondb_ros/ros_fixtures.h"

namespace moondb {
namespace {

TEST(FrameTreeTest, JoinsFramesOverTheirCommonAncestor) {
  FrameTree frames;
  ASSERT_TRUE(frames.Add(TransformAt(0, "base_footprint", "base_link", Pose::FromPlanar(0, 0, 0)), true));
  ASSERT_TRUE(frames.Add(TransformAt(0, "/base_link", "/laser", Pose::FromPlanar(0.2, 0, 3.14159265358979)), true));
  ASSERT_TRUE(frames.Add(TransformAt(1, "odom", "base_footprint", Pose::FromPlanar(5, 0, 0)), false));
  const auto pose = frames.Find("base_footprint", "laser", At(100));
  ASSERT_TRUE(pose);
  EXPECT_NEAR(pose->position_m.x(), 0.2, 1e-9);
  EXPECT_NEAR(std::abs(pose->Yaw()), 3.14159265, 1e-6);
  EXPECT_NEAR(frames.Find("laser", "odom", At(1))->Inverse().position_m.x(), 5.2, 1e-9);
  EXPECT_FALSE(frames.Find("base_link", "camera", At(0)));
  EXPECT_EQ(frames.ParentOf("odom"), "");
  EXPECT_EQ(frames.ParentOf("/laser"), "base_link");
}

TEST(FrameTreeTest, InterpolatesAndRefusesOldTransforms) {
  FrameTree frames;
  ASSERT_TRUE(frames.Add(TransformAt(1, "map", "odom", Pose::FromPlanar(1, 0, 0)), false));
  ASSERT_TRUE(frames.Add(TransformAt(1.4, "map", "odom", Pose::FromPlanar(2, 0, 0)), false));
  EXPECT_NEAR(frames.Find("map", "odom", At(1.2))->position_m.x(), 1.5, 1e-6);
  EXPECT_NEAR(frames.Find("map", "odom", At(1.8))->position_m.x(), 2, 1e-9);
  EXPECT_FALSE(frames.Find("map", "odom", At(2.0)));
  EXPECT_FALSE(frames.Find("map", "odom", At(0.4)));
}

TEST(FrameTreeTest, TakesANewParent) {
  FrameTree frames;
  ASSERT_TRUE(frames.Add(TransformAt(1, "map", "odom", Pose()), false));
  ASSERT_TRUE(frames.Add(TransformAt(1.1, "world", "odom", Pose::FromPlanar(3, 0, 0)), false));
  EXPECT_EQ(frames.ParentOf("odom"), "world");
  EXPECT_FALSE(frames.Find("map", "odom", At(1)));
}

TEST(FrameTreeTest, EndsWithARing) {
  FrameTree frames;
  ASSERT_TRUE(frames.Add(TransformAt(1, "a", "b", Pose()), true));
  ASSERT_TRUE(frames.Add(TransformAt(1, "b", "a", Pose()), true));
  EXPECT_FALSE(frames.Find("a", "c", At(1)));
}

TEST(FrameTreeTest, RefusesWhatIsNoTransform) {
  FrameTree frames;
  EXPECT_FALSE(frames.Add(TransformAt(0, "", "b", Pose()), true));
  EXPECT_FALSE(frames.Add(TransformAt(0, "b", "/b", Pose()), true));
  Pose bad;
  bad.orientation.coeffs() *= 0;
  EXPECT_FALSE(frames.Add(TransformAt(0, "a", "b", bad), true));
  for (std::size_t i = 0; i < FrameTree::kFramesMax; ++i) {
    ASSERT_TRUE(frames.Add(TransformAt(0, "a", "frame" + std::to_string(i), Pose()), true));
  }
  EXPECT_FALSE(frames.Add(TransformAt(0, "a", "one more", Pose()), true));
}

}  // namespace
}  // namespace moondb
