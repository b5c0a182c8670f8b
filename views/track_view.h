// TrackView: the trajectory of one robot. Thread-safe.
#pragma once

#include <vector>

#include "views/pose_view.h"

namespace moondb {

struct TrackView {
  AgentId agent = 0;
  std::vector<PoseView> poses;  // By timestamp, then by index.

  std::size_t CountOptimized() const;
};

// Returns one track for each agent with a pose, in the order of agents.
std::vector<TrackView> TracksOf(const std::vector<PoseView>& poses);

}  // namespace moondb
