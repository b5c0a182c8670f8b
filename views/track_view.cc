#include "views/track_view.h"

#include <algorithm>
#include <map>
#include <utility>

namespace moondb {

std::size_t TrackView::CountOptimized() const {
  return static_cast<std::size_t>(std::ranges::count_if(poses, &PoseView::is_optimized));
}

std::vector<TrackView> TracksOf(const std::vector<PoseView>& poses) {
  std::map<AgentId, TrackView> tracks;
  for (const PoseView& pose : poses) {
    TrackView& track = tracks[pose.node.agent];
    track.agent = pose.node.agent;
    track.poses.push_back(pose);
  }
  std::vector<TrackView> sorted;
  for (auto& [agent, track] : tracks) {
    std::ranges::sort(track.poses, {},
                      [](const PoseView& pose) { return std::pair(pose.timestamp_ns, pose.node.index); });
    sorted.push_back(std::move(track));
  }
  return sorted;
}

}  // namespace moondb
