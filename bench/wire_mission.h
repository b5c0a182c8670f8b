// Whole missions for wire_bench, as the records that a team shares: maps, pose graph and states of all rovers.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "model/error.h"
#include "model/traversability_map.h"
#include "proto/record.pb.h"

namespace moondb {

// Records of one data type from one origin, in order of seq.
struct WireStream {
  std::uint32_t data_type = 0;
  std::vector<proto::StoredRecord> records;
};

struct WireMission {
  std::string name;
  std::vector<WireStream> streams;                         // Streams in the order in which they are sent.
  std::vector<std::vector<TraversabilityMap>> rover_maps;  // All maps in the streams, one list per rover.
};

// Makes a mission with three rovers, about 5,400 records, and 300 maps of 4 layers of 128 x 128 cells. The maps move by
// whole cells over one grid and have 1 % noise.
WireMission MakeRollingMission();

// Makes a mission with the generator of moondb_mission. Its camera maps are aligned with the rover's heading.
Result<WireMission> MakeSingleViewMission();

// Reads a recorded mission (model/mission.h). The mission gets the name of its folder.
Result<WireMission> ReadRecordedMission(const std::filesystem::path& folder);

}  // namespace moondb
