#include "apps/moondb_ros/frame_tree.h"

#include <algorithm>
#include <cstdlib>

#include "apps/moondb_ros/odometry_track.h"

namespace moondb {

std::string FrameName(const std::string& name) { return name.starts_with('/') ? name.substr(1) : name; }

Result<void> FrameTree::Add(const RosTransform& transform, bool is_static) {
  const std::string parent = FrameName(transform.parent);
  const std::string child = FrameName(transform.child);
  if (parent.empty() || child.empty()) return Fail(ErrorCode::kInvalid, "a frame has no name");
  if (parent == child) return Fail(ErrorCode::kInvalid, "frame " + child + " is its own parent");
  const Result<Pose> pose = CheckedPose(transform.parent_from_child);
  if (!pose) return Fail(ErrorCode::kInvalid, "frame " + child + ": " + pose.error().text);
  if (!links_.contains(child) && links_.size() >= kFramesMax) {
    return Fail(ErrorCode::kInvalid, "more than " + std::to_string(kFramesMax) + " frames");
  }
  Link& link = links_[child];
  if (link.parent != parent || link.is_static || is_static) link = {parent, is_static, {}};
  const auto place =
      std::upper_bound(link.transforms.begin(), link.transforms.end(), transform.timestamp_ns,
                       [](std::int64_t timestamp, const Stamped& stamped) { return timestamp < stamped.timestamp_ns; });
  link.transforms.insert(place, {transform.timestamp_ns, *pose});
  if (link.transforms.size() > kTransformsMax) link.transforms.pop_front();
  return {};
}

std::string FrameTree::ParentOf(const std::string& frame) const {
  const auto link = links_.find(FrameName(frame));
  return link == links_.end() ? "" : link->second.parent;
}

bool FrameTree::IsBelow(const std::string& frame, const std::string& ancestor) const {
  const std::vector<std::string> chain = ChainOf(frame);
  return std::ranges::find(chain, FrameName(ancestor)) != chain.end();
}

std::vector<std::string> FrameTree::ChainOf(const std::string& frame) const {
  std::vector<std::string> chain = {FrameName(frame)};
  for (std::string parent = ParentOf(frame); !parent.empty() && chain.size() < kFramesMax; parent = ParentOf(parent)) {
    if (std::ranges::find(chain, parent) != chain.end()) break;  // Two publishers made a ring.
    chain.push_back(parent);
  }
  return chain;
}

std::optional<Pose> FrameTree::PoseAt(const Link& link, std::int64_t timestamp_ns) {
  if (link.is_static) return link.transforms.front().parent_from_child;
  const auto next =
      std::lower_bound(link.transforms.begin(), link.transforms.end(), timestamp_ns,
                       [](const Stamped& stamped, std::int64_t timestamp) { return stamped.timestamp_ns < timestamp; });
  const bool has_next = next != link.transforms.end() && next->timestamp_ns - timestamp_ns <= kAgeMax_ns;
  const bool has_last = next != link.transforms.begin() && timestamp_ns - (next - 1)->timestamp_ns <= kAgeMax_ns;
  if (has_next && has_last) {
    const Stamped& last = *(next - 1);
    const double part = static_cast<double>(timestamp_ns - last.timestamp_ns) /
                        static_cast<double>(next->timestamp_ns - last.timestamp_ns);
    return Interpolated(last.parent_from_child, next->parent_from_child, part);
  }
  if (has_next) return next->parent_from_child;
  if (has_last) return (next - 1)->parent_from_child;
  return std::nullopt;
}

std::optional<Pose> FrameTree::Climb(const std::vector<std::string>& chain, const std::string& ancestor,
                                     std::int64_t timestamp_ns) const {
  Pose ancestor_from_frame;
  for (const std::string& frame : chain) {
    if (frame == ancestor) return ancestor_from_frame;
    const auto link = links_.find(frame);
    if (link == links_.end()) return std::nullopt;
    const std::optional<Pose> pose = PoseAt(link->second, timestamp_ns);
    if (!pose) return std::nullopt;
    ancestor_from_frame = *pose * ancestor_from_frame;
  }
  return std::nullopt;
}

std::optional<Pose> FrameTree::Find(const std::string& to, const std::string& from, std::int64_t timestamp_ns) const {
  const std::vector<std::string> to_chain = ChainOf(to);
  const std::vector<std::string> from_chain = ChainOf(from);
  const auto common = std::ranges::find_first_of(from_chain, to_chain);
  if (common == from_chain.end()) return std::nullopt;
  const std::optional<Pose> common_from_from = Climb(from_chain, *common, timestamp_ns);
  const std::optional<Pose> common_from_to = Climb(to_chain, *common, timestamp_ns);
  if (!common_from_from || !common_from_to) return std::nullopt;
  return common_from_to->Inverse() * *common_from_from;
}

}  // namespace moondb
