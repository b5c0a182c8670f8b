// FrameTree: the transforms heard on /tf and /tf_static (REP-105), by time.
//
// Keeps the newest kTransformsMax transforms of each frame, and at most kFramesMax frames. Names lose a leading slash.
// Not thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "apps/moondb_ros/ros_messages.h"
#include "model/error.h"
#include "model/geometry.h"

namespace moondb {

// The name of a frame as tf2 uses it: without a leading slash.
std::string FrameName(const std::string& name);

class FrameTree {
 public:
  static constexpr std::size_t kFramesMax = 256;
  static constexpr std::size_t kTransformsMax = 200;
  static constexpr std::int64_t kAgeMax_ns = 500'000'000;

  // Adds a transform. If the frame had another parent, the new parent replaces it. Fails with kInvalid for an empty
  // name, a frame that is its own parent, a pose that CheckedPose refuses, or more than kFramesMax frames.
  Result<void> Add(const RosTransform& transform, bool is_static);

  // Returns to_from_from at a time: interpolated, or else the nearest transform within kAgeMax_ns. Static transforms
  // are valid at all times. nullopt if no chain of transforms joins the frames at that time.
  std::optional<Pose> Find(const std::string& to, const std::string& from, std::int64_t timestamp_ns) const;
  // Returns whether `frame` is `ancestor`, or hangs below it.
  bool IsBelow(const std::string& frame, const std::string& ancestor) const;
  // Returns the highest ancestor of a frame: the frame itself if it has no parent.
  std::string RootOf(const std::string& frame) const { return ChainOf(frame).back(); }
  // Returns the parent of a frame; an empty name if it has none.
  std::string ParentOf(const std::string& frame) const;

 private:
  struct Stamped {
    std::int64_t timestamp_ns = 0;
    Pose parent_from_child;
  };
  struct Link {
    std::string parent;
    bool is_static = false;
    std::deque<Stamped> transforms;  // In the order of their timestamps; one if static.
  };

  // The frame and its ancestors, at most kFramesMax.
  std::vector<std::string> ChainOf(const std::string& frame) const;
  static std::optional<Pose> PoseAt(const Link& link, std::int64_t timestamp_ns);
  // ancestor_from_frame along the chain, which begins at `frame`; nullopt if a transform is missing at that time.
  std::optional<Pose> Climb(const std::vector<std::string>& chain, const std::string& ancestor,
                            std::int64_t timestamp_ns) const;

  std::map<std::string, Link> links_;  // By child.
};

}  // namespace moondb
