// MapChecker: checks that an agent's merged map depends only on the records that the agent holds (invariant
// map_of_records). Agents that hold the same nodes, poses, maps and quarantines must return the same map, except at a
// rover that is not placed, which gets its own map alone (MergeReply.frame_of). The tiles
// that a following client received must together equal the map.
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
  // Checks `reply`, the merged map that `agent` returned for `request` while its have-set was `have`. Returns a
  // description if the map is wrong; null otherwise. Requires: if a client follows the agent's map, OnTiles was called
  // at the same instant.
  std::optional<std::string> OnMap(AgentId agent, const HaveSet& have, const proto::MergeRequest& request,
                                   const proto::MergeReply& reply);
  // Returns a description if two of the agents, asked last for the same request, returned different maps; null
  // otherwise. Call when all of them have got the same records. Maps of one rover alone (MergeReply.frame_of) are not
  // compared.
  std::optional<std::string> WhyNotAlike(const std::vector<AgentId>& agents) const;
  // One simulated client follows the map of each agent. NextTiles returns the client's next request. OnTiles adds the
  // tiles of the answer to the client's map, and returns a description if the tiles cannot be decoded or are
  // incomplete; null otherwise.
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

  std::map<std::string, Seen> maps_;     // First map seen for each request and set of held records.
  std::map<AgentId, std::string> last_;  // Last map of each agent: serialized MergeReply; empty if of one rover alone.
  std::map<AgentId, Followed> followed_;
};

// Compares the tiles that a client received with the merged map. Returns a description of the first difference; null if
// there is none.
std::optional<std::string> WhyOther(const std::map<std::pair<std::int64_t, std::int64_t>, Grid>& tiles,
                                    const MergedMap& merged);

}  // namespace moondb::simulation
