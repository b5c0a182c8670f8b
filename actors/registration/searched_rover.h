// SearchedRover: one rover's submaps, with what is needed to fuse them. Single-threaded.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "actors/registration/known_maps.h"
#include "actors/registration/submap.h"
#include "actors/registration/submap_sets.h"

namespace moondb {

class SearchedRover {
 public:
  // Returns the rover with those of `maps` that lie on its unbroken track; nullopt without a track. `in_frame`: agents
  // whose poses are in one frame with the rover's, and which its maps may show.
  static std::optional<SearchedRover> Find(AgentId agent, const std::vector<RegisteredMap>& maps,
                                           const KnownMaps& known, std::set<AgentId> in_frame = {});

  const TrackSubmaps& submaps() const { return submaps_; }
  const std::vector<SubmapWindow>& windows() const { return submaps_.windows; }
  const RegisteredMap& map(const RecordKey& key) const { return maps_.at(key); }
  // Fuses a window without maps whose cells are gone.
  std::shared_ptr<const Submap> Fuse(std::size_t window, const KnownMaps& known) const;
  // Returns map_from_submap by the solved pose of the map that is nearest to the middle.
  PlanarOffset SolvedPose(std::size_t window) const;

 private:
  std::map<RecordKey, RegisteredMap> maps_;
  std::set<AgentId> in_frame_;
  TrackSubmaps submaps_;
};

}  // namespace moondb
