#include "actors/registration/searched_rover.h"

#include <algorithm>
#include <utility>

namespace moondb {

std::optional<SearchedRover> SearchedRover::Find(AgentId agent, const std::vector<RegisteredMap>& maps,
                                                 const KnownMaps& known, std::set<AgentId> in_frame) {
  const std::shared_ptr<const RoverTrack> track = known.FindTrack(agent);
  if (!track) return std::nullopt;
  SearchedRover rover;
  rover.in_frame_ = std::move(in_frame);
  std::map<NodeKey, std::size_t> indices;
  for (std::size_t i = 0; i < track->size(); ++i) indices[track->node(i)] = i;
  std::vector<TrackMap> on_track;
  for (const RegisteredMap& map : maps) {
    const auto index = indices.find(map.node);
    if (index == indices.end()) continue;
    const PlanarOffset node_from_local =
        PlanarOffset::From(map.map_from_node).Inverse() * PlanarOffset::From(map.map_from_local);
    on_track.push_back({map.key, index->second, track->odom_from_node(index->second) * node_from_local});
    rover.maps_.emplace(map.key, map);
  }
  rover.submaps_ = {track, FindWindows(*track, std::move(on_track))};
  return rover;
}

std::shared_ptr<const Submap> SearchedRover::Fuse(std::size_t window, const KnownMaps& known) const {
  const PlanarOffset submap_from_odom = submaps_.OdomFromSubmap(window).Inverse();
  std::vector<Submap::Source> sources;
  for (const TrackMap& map : windows()[window].maps) {
    std::optional<TraversabilityMap> cells = known.FindMap(map.key);
    if (!cells) continue;
    sources.push_back(
        {*std::move(cells), submap_from_odom * map.odom_from_local, known.FindRovers(maps_.at(map.key), &in_frame_)});
  }
  return std::make_shared<const Submap>(sources);
}

PlanarOffset SearchedRover::SolvedPose(std::size_t window) const {
  const SubmapWindow& of = windows()[window];
  const TrackMap& nearest = *std::ranges::min_element(of.maps, {}, [&](const TrackMap& map) {
    return map.index > of.middle ? map.index - of.middle : of.middle - map.index;
  });
  return PlanarOffset::From(maps_.at(nearest.key).map_from_local) * nearest.odom_from_local.Inverse() *
         submaps_.OdomFromSubmap(window);
}

}  // namespace moondb
