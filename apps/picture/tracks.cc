#include "apps/picture/tracks.h"

#include <iterator>

namespace moondb {

Color AgentColor(std::size_t index) {
  static constexpr Color kColors[] = {{0, 114, 178}, {213, 94, 0},   {0, 158, 115},  {204, 121, 167},
                                      {230, 159, 0}, {86, 180, 233}, {120, 80, 200}, {150, 130, 20}};
  return kColors[index % std::size(kColors)];
}

std::vector<Track> TracksOf(const std::map<NodeKey, Pose>& poses, const std::vector<TrackAgent>& agents) {
  std::vector<Track> tracks;
  for (std::size_t index = 0; index < agents.size(); ++index) {
    Track track;
    track.name = agents[index].name;
    track.color = AgentColor(index);
    for (auto it = poses.lower_bound(NodeKey{agents[index].id, 0}); it != poses.end(); ++it) {
      if (it->first.agent != agents[index].id) break;
      track.points.push_back({it->second.position_m.x(), it->second.position_m.y()});
    }
    tracks.push_back(std::move(track));
  }
  return tracks;
}

std::vector<Track> ComparedTracks(std::vector<Track> truth, std::vector<Track> before, const std::string& before_name,
                                  const std::vector<Track>& after) {
  std::vector<Track> all;
  const auto add = [&all](std::vector<Track> tracks, TrackStyle style, const std::string& name, const Color& color) {
    for (Track& track : tracks) all.push_back({name, color, style, std::move(track.points)});
  };
  add(std::move(truth), TrackStyle::kBroad, "true track", {196, 198, 204});
  add(std::move(before), TrackStyle::kDashed, before_name, {70, 70, 70});
  all.insert(all.end(), after.begin(), after.end());
  return all;
}

}  // namespace moondb
