// Messages of Foxglove's schemas (proto/foxglove.proto) from views of the team. Frames: `map`, and one for each agent
// by its name. Thread-safe.
#pragma once

#include <cstdint>
#include <string>

#include "apps/moondb_view/graph_book.h"
#include "proto/foxglove.pb.h"
#include "proto/team.pb.h"
#include "views/event_view.h"

namespace moondb {

inline constexpr char kMapFrameId[] = "map";

// A square of cells of the merged map. Cells: 0 unknown, 1 free, 2 hazard, row by row from the smallest y.
struct CellBlock {
  std::int64_t origin_cell_x = 0;
  std::int64_t origin_cell_y = 0;
  std::uint32_t side_cells = 0;
  std::uint32_t resolution_um = 0;
  std::string cells;
};

foxglove::Grid GridOf(const CellBlock& block, const std::string& frame, std::int64_t timestamp_ns);

// The newest poses of placed agents.
foxglove::FrameTransforms TransformsOf(const proto::TeamConfig& team, const GraphView& view);
foxglove::PosesInFrame PosesOf(const GraphView& view);
// Trajectories with names, and measurements: one entity for each agent and kind. Rejected measurements are an entity of
// their own.
foxglove::SceneUpdate SceneOf(const proto::TeamConfig& team, const GraphView& view, std::int64_t timestamp_ns);
foxglove::Log LogOf(const std::string& agent, const EventView& event);

// Returns the FileDescriptorSet of a message's schema with all that it imports, serialized.
std::string SchemaOf(const google::protobuf::Descriptor& message);

}  // namespace moondb
