// MapChecker: whether agents' merged maps depend on their records alone, as clients see it: the rule map_of_records.
// Whoever holds the same nodes, poses, maps and quarantines gives the same map, whenever it is asked; and the tiles
// that one who follows the map was sent are the map.
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
  // `agent` gives this merged map, and what it has now is `have`. What is wrong, if anything. Where a client follows
  // its map, OnTiles came at the same instant.
  std::optional<std::string> OnMap(AgentId agent, const HaveSet& have, const proto::MergeRequest& request,
                                   const proto::MergeReply& reply);
  // One client follows the map of each agent: what it asks for next, and what it is sent.
  proto::MapTilesRequest NextTiles(AgentId agent) const;
  std::optional<std::string> OnTiles(AgentId agent, const proto::MapTilesReply& reply);

 private:
  struct Seen {
    AgentId agent = 0;
    std::string map;  // All that a MergeReply says of it.
  };
  struct Followed {
    std::uint64_t merger_id = 0;
    std::uint64_t version = 0;
    std::map<std::pair<std::int64_t, std::int64_t>, Grid> tiles;  // By column and row of tiles.
  };

  std::map<std::string, Seen> maps_;  // By what was asked and what was held.
  std::map<AgentId, Followed> followed_;
};

// The rule map_of_records of what one client follows: nothing, or where the two differ.
std::optional<std::string> WhyOther(const std::map<std::pair<std::int64_t, std::int64_t>, Grid>& tiles,
                                    const MergedMap& merged);

}  // namespace moondb::simulation
