// Usage: survey ENDPOINT AGENT AGENT_ID. Stores a reading, a pose and a local map, and takes the merged map.
#include <chrono>
#include <cstdio>
#include <cstdlib>

#include "client/client.h"

// Returns a record with the time of now.
moondb::proto::Record NewRecord() {
  moondb::proto::Record record;
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  record.set_timestamp_ns(std::chrono::duration_cast<std::chrono::nanoseconds>(now).count());
  return record;
}

// Returns a map of 4 m x 4 m around a node, with a hazard at its right edge.
moondb::proto::Record MapAt(const moondb::proto::NodeKey& node) {
  moondb::Grid grid(40, 40, moondb::Cell::kFree);
  for (int row = 0; row < grid.height; ++row) grid.At(39, row) = moondb::Cell::kHazard;
  moondb::proto::Record record = NewRecord();
  auto& map = *record.mutable_local_traversability_map();
  *map.mutable_node() = node;
  map.mutable_node_from_map()->mutable_position_m();
  map.mutable_node_from_map()->mutable_orientation()->set_w(1);
  moondb::proto::MapLayer& layer = *map.add_layers();
  layer.set_width_cells(grid.width);
  layer.set_height_cells(grid.height);
  layer.set_resolution_um(100'000);
  layer.set_cells(PackCells(grid));
  return record;
}

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  const auto fail = [](const moondb::Error& error) { return std::fprintf(stderr, "%s\n", ToString(error).c_str()), 1; };
  const auto client = moondb::Client::Connect(argv[1], argv[2], {});
  if (!client) return fail(client.error());
  const auto index = (*client)->NextNodeIndex();  // Nodes of earlier runs have lower indexes.
  if (!index) return fail(index.error());
  moondb::proto::Record reading = NewRecord(), pose = NewRecord();
  reading.mutable_temperature()->set_celsius(-40.5);
  auto& node = *pose.mutable_pose_graph_node();
  node.mutable_node()->set_agent_id(std::strtoul(argv[3], nullptr, 10));
  node.mutable_node()->set_index(*index);
  node.mutable_map_from_node()->mutable_position_m()->set_x(5.0 + static_cast<double>(*index));
  node.mutable_map_from_node()->mutable_orientation()->set_w(1);
  const auto keys = (*client)->Insert({reading, pose, MapAt(node.node())});
  if (!keys) return fail(keys.error());
  std::printf("stored %zu records, the first as %s\n", keys->size(), ToString(keys->front()).c_str());
  const auto merged = (*client)->Merge({});
  if (!merged) return fail(merged.error());
  std::printf("merged map: %d x %d cells\n", merged->map.grid.width, merged->map.grid.height);
}
