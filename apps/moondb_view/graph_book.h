// GraphBook: the team's pose graph as the page draws it: trajectories, and measurements as lines. Not thread-safe.
#pragma once

#include <map>
#include <string>

#include "actors/pgo/known_graph.h"
#include "model/record_authority.h"
#include "proto/record.pb.h"
#include "proto/team.pb.h"

namespace moondb {

class GraphBook {
 public:
  // Lines beyond this number are left out, those between the oldest nodes first.
  static constexpr std::size_t kLinesMax = 5000;
  // Longer trajectories lose every second node until they fit. The newest node stays.
  static constexpr std::size_t kTrackPosesMax = 2000;

  // Requires: `team` outlives the book.
  explicit GraphBook(const proto::TeamConfig& team);

  // Adds a record of the graph, a quarantine or a role assignment. Ignores records that agents ignore, and damaged
  // ones.
  void Add(const RecordKey& key, const proto::Record& record);
  // Returns true if a record that was ignored has become valid: all records must be added again, to a new book.
  bool TakeOutdated() { return authority_.TakeOutdated(); }

  struct Pages {
    std::string poses;  // The part "poses" of the page.
    std::string lines;
    std::map<AgentId, bool> is_placed;  // Agents with a node.
  };
  Pages Write() const;

 private:
  const proto::TeamConfig& team_;
  RecordAuthority authority_;
  KnownGraph graph_;
};

}  // namespace moondb
