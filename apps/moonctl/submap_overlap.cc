#include "apps/moonctl/submap_overlap.h"

#include <algorithm>
#include <map>

#include "apps/common/graph_reading.h"
#include "model/agent_name.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

// Fuses the maps of a rover's nodes at their raw poses.
Result<TraversabilityMap> ReadSubmap(Client& client, const std::map<NodeKey, Pose>& raw, AgentId rover,
                                     const proto::SubmapNodes& nodes) {
  const auto middle = raw.find({rover, nodes.middle()});
  if (middle == raw.end()) return Fail(ErrorCode::kNotFound, "the agent lacks nodes of the submap");
  proto::ReadRequest request;
  request.add_data_types(proto::LOCAL_TRAVERSABILITY_MAP);
  request.add_origin_agents(rover);
  std::vector<Submap::Source> sources;
  const auto take = [&](const proto::StoredRecord&, const proto::Record& record) -> Result<void> {
    const NodeKey node = FromProto(record.local_traversability_map().node());
    const auto pose = raw.find(node);
    if (node.agent != rover || node.index < nodes.first() || node.index > nodes.last() || pose == raw.end()) return {};
    auto map = FromProto(record.local_traversability_map());
    if (!map) return tl::unexpected(map.error());
    const PlanarOffset submap_from_local = PlanarOffset::Between(middle->second, pose->second * map->node_from_map);
    sources.push_back({*std::move(map), submap_from_local, {}});
    return {};
  };
  if (auto read = client.ReadAll(request, take); !read) return tl::unexpected(read.error());
  return CellsOf(Submap(sources));
}

}  // namespace

TraversabilityMap CellsOf(const Submap& submap) {
  const DistanceField& distances = submap.distances();
  const int side = distances.grid().side_cells;
  TraversabilityMap map;
  MapLayer& layer = map.layers.emplace_back();
  layer.resolution_um = static_cast<std::uint32_t>(Submap::kCell_m * 1e6 + 0.5);
  layer.grid = Grid(side, side);
  for (int row = 0; row < side; ++row) {
    for (int column = 0; column < side; ++column) {
      const std::size_t index = distances.grid().IndexOf(column, row);
      if (distances.IsKnown(index)) layer.grid.At(column, row) = Cell::kFree;
      if (distances.UnitsAt(index) == 0) layer.grid.At(column, row) = Cell::kHazard;
    }
  }
  return map;
}

Result<Overlap> ReadSubmaps(AgentClient& target, const proto::TeamConfig& team, AgentId first, AgentId second) {
  const auto state = target.client->Registration({});
  if (!state) return tl::unexpected(state.error());
  const auto start = std::ranges::find_if(state->starts(), [&](const proto::SearchedStart& one) {
    return std::minmax<AgentId>(one.agent_id(), one.other_agent_id()) == std::minmax(first, second);
  });
  const std::string names = AgentName(team, first) + " and " + AgentName(team, second);
  if (start == state->starts().end()) {
    return Fail(ErrorCode::kNotFound, "the leader has not searched for the relative pose of " + names +
                                          ": the leader searches only if one of them is not placed");
  }
  if (!start->has_place()) return Fail(ErrorCode::kNotFound, "no two submaps of " + names + " match");
  const auto known = ReadGraphOf(*target.client, team);
  if (!known) return tl::unexpected(known.error());
  std::map<NodeKey, Pose> raw;
  for (const GraphNode& node : known->graph().nodes) raw[node.key] = node.map_from_node;
  const bool is_in_order = start->agent_id() == first;
  const proto::PlacedSubmaps& place = start->place();
  auto first_map = ReadSubmap(*target.client, raw, first, is_in_order ? place.submap() : place.other_submap());
  if (!first_map) return tl::unexpected(first_map.error());
  auto second_map = ReadSubmap(*target.client, raw, second, is_in_order ? place.other_submap() : place.submap());
  if (!second_map) return tl::unexpected(second_map.error());
  const PlanarOffset found{place.x_m(), place.y_m(), place.yaw_rad()};
  Overlap overlap;
  overlap.maps = {*std::move(first_map), *std::move(second_map), AgentName(team, first), AgentName(team, second)};
  overlap.placements = {{"search", Pose(), (is_in_order ? found : found.Inverse()).ToPose()}};
  overlap.remarks = {start->is_accepted() ? "accepted" : "not accepted: " + start->text()};
  return overlap;
}

}  // namespace moondb
