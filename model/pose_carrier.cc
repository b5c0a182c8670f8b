#include "model/pose_carrier.h"

namespace moondb {

std::optional<ValidPose> PoseCarrier::Next(const NodeKey& node, const Pose* raw, const Pose* optimized,
                                           bool is_unplaced) {
  if (node.agent != last_.agent) base_.reset();
  is_connected_ = is_connected_ && node.agent == last_.agent && node.index == last_.index + 1 && raw != nullptr &&
                  (raw->position_m - last_raw_position_m_).norm() <= kCarriedStep_m;
  last_ = node;
  if (raw != nullptr) last_raw_position_m_ = raw->position_m;
  if (optimized != nullptr) {
    if (raw != nullptr) {
      base_ = Base{*optimized * raw->Inverse(), is_unplaced};
      is_connected_ = true;
    }
    return ValidPose{*optimized, PoseSource::kOptimized, is_unplaced};
  }
  if (raw == nullptr) return std::nullopt;
  if (!base_) return ValidPose{*raw, PoseSource::kRaw};
  if (!is_connected_) return std::nullopt;
  return ValidPose{base_->map_from_odom * *raw, PoseSource::kCarried, base_->is_unplaced};
}

}  // namespace moondb
