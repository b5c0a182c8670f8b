// MapChecker: checks that an agent's merged map depends only on its records, as clients see them (invariant
// map_of_records). Agents that hold the same nodes, poses, maps and quarantines give the same map at any time. The
// tiles sent to a client that follows the map together equal the map.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "model/grid.h"
#include "model/have_set.h"
#include "proto/control.pb.h"

namespace moondb::simulation {

class MapChecker {
 public:
  // Checks the merged map that `agent` gives while its have-set is `have`. Returns a text if the map is wrong.
  // Requires: if a client follows the agent's map, OnTiles was called at the same instant.
  std::optional<std::string> OnMap(AgentId agent, const HaveSet& have, const proto::MergeRequest& request,
                                   const proto::MergeReply& reply);
  // One client follows the map of each agent. NextTiles returns the client's next request. OnTiles checks the tiles of
  // the answer, adds them to the client's map, and returns a text if they are wrong.
  proto::MapTilesRequest NextTiles(AgentId agent) const;
  std::optional<std::string> OnTiles(AgentId agent, const proto::MapTilesReply& reply);

 private:
  struct Seen {
    AgentId agent = 0;
    std::string map;  // Serialized MergeReply, without its duration.
  };
  struct Followed {
    std::uint64_t merger_id = 0;
    std::uint64_t version = 0;
    std::map<std::pair<std::int64_t, std::int64_t>, Grid> tiles;  // Received tiles by column and row.
  };

  std::map<std::string, Seen> maps_;  // First map seen for each request and set of held records.
  std::map<AgentId, Followed> followed_;
};

// Compares the tiles that a client received with the merged map. Returns the first difference; null if none.
std::optional<std::string> WhyOther(const std::map<std::pair<std::int64_t, std::int64_t>, Grid>& tiles,
                                    const MergedMap& merged);

}  // namespace moondb::simulation
