#include "model/geometry.h"

#include <gtest/gtest.h>

#include <cmath>

#include "model/data_types.h"
#include "model/ids.h"
#include "proto/pose.pb.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

TEST(PoseTest, ComposesFromTheRight) {
  const Pose a_from_b = Pose::FromPlanar(1, 2, M_PI / 2);
  const Pose b_from_c = Pose::FromPlanar(3, 0, 0);
  const Pose a_from_c = a_from_b * b_from_c;
  EXPECT_NEAR(a_from_c.position_m.x(), 1, 1e-12);
  EXPECT_NEAR(a_from_c.position_m.y(), 5, 1e-12);
  EXPECT_NEAR(a_from_c.Yaw(), M_PI / 2, 1e-12);
}

TEST(PoseTest, IsUndoneByItsInverse) {
  const Pose pose{Eigen::Vector3d(1, -2, 3), Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5)};
  const Pose nothing = pose * pose.Inverse();
  EXPECT_NEAR(nothing.position_m.norm(), 0, 1e-12);
  EXPECT_NEAR(std::abs(nothing.orientation.w()), 1, 1e-12);
}

TEST(PoseTest, RefusesInvalidPoses) {
  proto::Pose pose = ToProto(Pose());
  pose.mutable_position_m()->set_y(2e9);
  EXPECT_FALSE(FromProto(pose).has_value());
  pose = ToProto(Pose());
  pose.clear_orientation();
  EXPECT_FALSE(FromProto(pose).has_value());
  pose = ToProto(Pose());
  pose.mutable_orientation()->set_w(INFINITY);
  EXPECT_FALSE(FromProto(pose).has_value());
}

TEST(IdsTest, NamesEveryBuiltInTypeAndReadsItBack) {
  for (int type = 1; type < 100; ++type) {
    if (!proto::DataType_IsValid(type)) continue;
    const DataType id = static_cast<DataType>(type);
    EXPECT_EQ(DataTypeFromName(DataTypeName(id)), id);
  }
  EXPECT_EQ(DataTypeName(proto::LOCAL_TRAVERSABILITY_MAP), "local_traversability_map");
  EXPECT_EQ(DataTypeFromName("temperatur"), std::nullopt);
  EXPECT_EQ(DataTypeName(1007), "type_1007");
}

TEST(IdsTest, SharesStatesFirstAndMapsLast) {
  EXPECT_LT(SharingRank(proto::HEALTH), SharingRank(proto::POSE_GRAPH_NODE));
  EXPECT_LT(SharingRank(proto::POSE_GRAPH_NODE), SharingRank(proto::POSE_GRAPH_EDGE));
  EXPECT_LT(SharingRank(1000), SharingRank(proto::LOCAL_TRAVERSABILITY_MAP));
}

}  // namespace
}  // namespace moondb
