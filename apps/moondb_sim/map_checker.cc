#include "apps/moondb_sim/map_checker.h"

#include <algorithm>

#include "client/merged_map.h"
#include "proto/types.pb.h"

namespace moondb::simulation {
namespace {

// Returns whether merged maps depend on records of the type.
bool IsMerged(DataType type) {
  return type == proto::POSE_GRAPH_NODE || type == proto::OPTIMIZED_POSE || type == proto::LOCAL_TRAVERSABILITY_MAP ||
         type == proto::MAP_QUARANTINE;
}

std::string MergedOf(const HaveSet& have) {
  HaveSet merged;
  for (const auto& [key, stream] : have.streams()) {
    if (IsMerged(key.type) && !stream.held.is_empty()) merged[key].held = stream.held;
  }
  return ToProto(merged).SerializeAsString();
}

// Returns the cell at (x, y) from the tile that covers it; kUnknown if no tile covers it.
Cell CellOf(const std::map<std::pair<std::int64_t, std::int64_t>, Grid>& tiles, std::int64_t x, std::int64_t y) {
  const std::int64_t side = tiles.begin()->second.width;
  const auto floor = [side](std::int64_t cell) { return (cell >= 0 ? cell : cell - side + 1) / side; };
  const auto tile = tiles.find({floor(x), floor(y)});
  if (tile == tiles.end()) return Cell::kUnknown;
  return tile->second.At(static_cast<std::int32_t>(x - floor(x) * side),
                         static_cast<std::int32_t>(y - floor(y) * side));
}

std::int64_t KnownCells(const Grid& grid) {
  return std::count_if(grid.cells.begin(), grid.cells.end(), [](Cell cell) { return cell != Cell::kUnknown; });
}

}  // namespace

std::optional<std::string> WhyOther(const std::map<std::pair<std::int64_t, std::int64_t>, Grid>& tiles,
                                    const MergedMap& merged) {
  std::int64_t known = 0;
  for (const auto& [place, grid] : tiles) known += KnownCells(grid);
  if (known != KnownCells(merged.grid)) {
    return std::to_string(known) + " cells are known in tiles, " + std::to_string(KnownCells(merged.grid)) +
           " in the merged map";
  }
  for (std::int32_t row = 0; row < merged.grid.height && known > 0; ++row) {
    for (std::int32_t column = 0; column < merged.grid.width; ++column) {
      const std::int64_t x = merged.origin_cell_x + column;
      const std::int64_t y = merged.origin_cell_y + row;
      if (CellOf(tiles, x, y) == merged.grid.At(column, row)) continue;
      return "cell " + std::to_string(x) + ", " + std::to_string(y) + " of the tiles is not the merged map's";
    }
  }
  return std::nullopt;
}

std::optional<std::string> MapChecker::OnMap(AgentId agent, const HaveSet& have, const proto::MergeRequest& request,
                                             const proto::MergeReply& reply) {
  proto::MergeReply said = reply;
  said.clear_seconds();
  const bool is_of_one = request.agents_size() == 1 && request.agents(0) == reply.frame_of();
  if (reply.frame_of() != 0 && reply.frame_of() != agent && !is_of_one) {
    return "agent " + std::to_string(agent) + " returns the map of agent " + std::to_string(reply.frame_of()) +
           " alone";
  }
  last_[agent] = reply.frame_of() == 0 ? said.SerializeAsString() : std::string();
  // A rover that is not placed gets its own map alone from its own agent.
  const std::string frame = std::to_string(reply.frame_of());
  const auto [seen, is_new] =
      maps_.try_emplace(frame + request.SerializeAsString() + MergedOf(have), Seen{agent, said.SerializeAsString()});
  if (!is_new && seen->second.map != said.SerializeAsString()) {
    return "agents " + std::to_string(agent) + " and " + std::to_string(seen->second.agent) +
           " hold the same records and merge different maps";
  }
  const auto followed = followed_.find(agent);
  const bool is_everything = !request.use_raw_poses() && request.agents().empty();
  if (!is_everything || followed == followed_.end()) return std::nullopt;
  const Result<MergedMap> merged = DecodeMergedMap(reply);
  if (!merged) return "the merged map: " + ToString(merged.error());
  const std::optional<std::string> wrong = WhyOther(followed->second.tiles, *merged);
  return wrong ? std::optional("agent " + std::to_string(agent) + ": " + *wrong) : std::nullopt;
}

std::optional<std::string> MapChecker::WhyNotAlike(const std::vector<AgentId>& agents) const {
  std::optional<AgentId> first;
  for (const AgentId agent : agents) {
    const auto map = last_.find(agent);
    if (map == last_.end() || map->second.empty()) continue;
    if (!first) first = agent;
    if (map->second == last_.at(*first)) continue;
    return "agents " + std::to_string(*first) + " and " + std::to_string(agent) + " merge different maps";
  }
  return std::nullopt;
}

proto::MapTilesRequest MapChecker::NextTiles(AgentId agent) const {
  proto::MapTilesRequest request;
  const auto followed = followed_.find(agent);
  if (followed == followed_.end()) return request;
  request.set_merger_id(followed->second.merger_id);
  request.set_since_version(followed->second.version);
  return request;
}

std::optional<std::string> MapChecker::OnTiles(AgentId agent, const proto::MapTilesReply& reply) {
  Followed& followed = followed_[agent];
  if (reply.merger_id() != followed.merger_id) followed.tiles.clear();
  followed.merger_id = reply.merger_id();
  followed.version = reply.version();
  const Result<std::vector<MergedTile>> tiles = DecodeMapTiles(reply);
  if (!tiles || !reply.is_complete()) return "tiles of agent " + std::to_string(agent) + " cannot be read";
  for (const MergedTile& tile : *tiles) followed.tiles[{tile.x, tile.y}] = tile.map.grid;
  return std::nullopt;
}

}  // namespace moondb::simulation
