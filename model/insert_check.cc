#include "model/insert_check.h"

#include <Eigen/Cholesky>
#include <string>
#include <string_view>

#include "model/pose_graph.h"
#include "model/text.h"

namespace moondb {

namespace {

using Triangle = google::protobuf::RepeatedField<double>;

// A planar robot moves along these axes.
bool IsPlanar(std::string_view axis) { return axis == "x" || axis == "y" || axis == "yaw"; }

Result<void> CheckVariance(double variance, const std::string& name, const std::string& field) {
  if (variance >= kVarianceMin && variance <= kVarianceMax) return {};
  return Fail(ErrorCode::kInvalid,
              "the variance of " + name + " is " + FormatDouble(variance) + ", and must lie between 1e-12 and 1e8",
              field);
}

Result<void> CheckCovariance(const Triangle& upper_triangle, int size, const std::string& field) {
  const Result<Matrix6d> covariance = FromUpperTriangle(upper_triangle, size);
  if (!covariance) return tl::unexpected(covariance.error());
  for (int i = 0; i < size; ++i) {
    const std::string axis = AxisName(i, size);
    const double variance = (*covariance)(i, i);
    if (!IsPlanar(axis) && variance > kVarianceMax) continue;
    if (const Result<void> checked = CheckVariance(variance, axis, field); !checked) return checked;
  }
  // The squared diagonal of the Cholesky factor holds each variance conditioned on the preceding ones.
  const Eigen::LLT<Matrix6d> factorised(*covariance);
  if (factorised.matrixLLT().diagonal().cwiseAbs2().minCoeff() >= kVarianceMin) return {};
  return Fail(ErrorCode::kInvalid, "is nearly singular: some combination of its axes has a variance below 1e-12",
              field);
}

Result<void> CheckEdge(const proto::PoseGraphEdge& edge) {
  if (edge.has_relative_pose()) {
    return CheckCovariance(edge.relative_pose().covariance(), 6, "pose_graph_edge.relative_pose.covariance");
  }
  return CheckVariance(edge.range().variance_m2(), "the range", "pose_graph_edge.range.variance_m2");
}

Result<void> CheckQuarantine(const proto::MapQuarantine& quarantine, bool is_local) {
  if (is_local) {
    return Fail(ErrorCode::kInvalid, "cannot be local: a quarantine applies to the whole team", "map_quarantine");
  }
  if (!quarantine.signature().empty()) {
    return Fail(ErrorCode::kInvalid, "must be empty: this agent signs the record", "map_quarantine.signature");
  }
  if (quarantine.has_term()) {
    return Fail(ErrorCode::kInvalid, "must be absent: this agent sets it", "map_quarantine.term");
  }
  return {};
}

}  // namespace

Result<void> CheckForInsert(const proto::Record& record, bool is_local) {
  switch (record.body_case()) {
    case proto::Record::kMapQuarantine:
      return CheckQuarantine(record.map_quarantine(), is_local);
    case proto::Record::kPoseGraphEdge:
      return CheckEdge(record.pose_graph_edge());
    case proto::Record::kPosePrior: {
      const proto::PosePrior& prior = record.pose_prior();
      const int size = prior.has_position_m() ? 3 : prior.has_position_yaw() ? 4 : 6;
      return CheckCovariance(prior.covariance(), size, "pose_prior.covariance");
    }
    default:
      return {};
  }
}

}  // namespace moondb
