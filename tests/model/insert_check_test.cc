#include "model/insert_check.h"

#include <gmock/gmock.h>

#include <cmath>
#include <vector>

#include "model/pose_graph.h"
#include "model/record_check.h"

namespace moondb {
namespace {

using testing::HasSubstr;

// Returns odometry with these variances of x, y, z, roll, pitch and yaw.
proto::Record StepWith(const std::vector<double>& variances) {
  OdometryEdge edge;
  edge.from = {2, 0};
  edge.to = {2, 1};
  edge.from_from_to = Pose::FromPlanar(1, 0, 0);
  proto::Record record = ToRecord(edge);
  auto& triangle = *record.mutable_pose_graph_edge()->mutable_relative_pose()->mutable_covariance();
  triangle.Clear();
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) triangle.Add(row == column ? variances[row] : 0);
  }
  return record;
}

// Returns the text of the refusal by CheckRecord or CheckForInsert; empty if the record is accepted.
std::string Refusal(const proto::Record& record) {
  if (const auto checked = CheckRecord(record); !checked) return checked.error().text;
  const auto checked = CheckForInsert(record);
  return checked ? "" : checked.error().text;
}

TEST(InsertCheckTest, AcceptsWhatPlanarDriversState) {
  for (const double unused : {1e6, 1e10, 1e300, 1e308}) {
    EXPECT_EQ(Refusal(StepWith({0.01, 0.01, unused, unused, unused, 0.005})), "") << unused;
  }
}

TEST(InsertCheckTest, RefusesUnusableVariancesAndNamesTheAxis) {
  EXPECT_THAT(Refusal(StepWith({1e10, 0.01, 0.01, 0.01, 0.01, 0.01})), HasSubstr("the variance of x is 1e+10"));
  EXPECT_THAT(Refusal(StepWith({0.01, 0.01, 0.01, 0.01, 0.01, 1e9})), HasSubstr("the variance of yaw is 1e+09"));
  EXPECT_THAT(Refusal(StepWith({0.01, 1e-13, 0.01, 0.01, 0.01, 0.01})), HasSubstr("the variance of y is 1e-13"));
  EXPECT_THAT(Refusal(StepWith({0.01, 0.01, 1e-13, 0.01, 0.01, 0.01})), HasSubstr("the variance of z is 1e-13"));
  EXPECT_THAT(Refusal(StepWith({0, 0, 0, 0, 0, 0})), HasSubstr("the variance of x is 0"));
  EXPECT_THAT(Refusal(StepWith({0.01, 0.01, 0, 0, 0, 0.01})), HasSubstr("the variance of z is 0"));
  EXPECT_THAT(Refusal(StepWith({-1, 0.01, 0.01, 0.01, 0.01, 0.01})), HasSubstr("the variance of x is -1"));
  EXPECT_THAT(Refusal(StepWith({0.01, NAN, 0.01, 0.01, 0.01, 0.01})), HasSubstr("the variance of y is"));
}

TEST(InsertCheckTest, RefusesANearlySingularCovariance) {
  proto::Record record = StepWith({1, 1, 0.01, 0.01, 0.01, 0.01});
  record.mutable_pose_graph_edge()->mutable_relative_pose()->set_covariance(1, 1 - 1e-14);
  EXPECT_THAT(Refusal(record), HasSubstr("nearly singular"));
}

TEST(InsertCheckTest, ChecksRangesAndPriors) {
  proto::Record range = ToRecord(RangeEdge{{1, 0}, {2, 0}, 0, 3, 1e-13});
  EXPECT_THAT(Refusal(range), HasSubstr("the variance of the range is 1e-13"));
  range.mutable_pose_graph_edge()->mutable_range()->set_variance_m2(0.01);
  EXPECT_EQ(Refusal(range), "");
  NodePrior prior;
  prior.node = {2, 0};
  prior.extent = PriorExtent::kPositionYaw;
  prior.source = "gnss";
  prior.covariance(3, 3) = 1e9;
  EXPECT_THAT(Refusal(ToRecord(prior)), HasSubstr("the variance of yaw is 1e+09"));
  prior.covariance(3, 3) = 0.1;
  prior.covariance(2, 2) = 1e10;
  EXPECT_EQ(Refusal(ToRecord(prior)), "") << "many receivers do not measure the height";
}

TEST(LimitVariancesTest, ScalesAxesThatAreNotMeasured) {
  Matrix6d covariance = Matrix6d::Identity() * 0.01;
  covariance(2, 2) = 1e300;
  covariance(0, 2) = covariance(2, 0) = 1e148;
  covariance(1, 1) = 1e-14;
  LimitVariances(covariance);
  EXPECT_DOUBLE_EQ(covariance(2, 2), kUnmeasuredVariance);
  EXPECT_NEAR(covariance(0, 2), 10, 1e-9) << "the correlation stays";
  EXPECT_GE(covariance(1, 1), kVarianceMin);
  EXPECT_NEAR(covariance(0, 0), 0.01, 1e-9);
}

}  // namespace
}  // namespace moondb
