// Whole missions as the records that a team shares, for wire_bench: maps, pose graph and states of all rovers.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "model/error.h"
#include "model/traversability_map.h"
#include "proto/record.pb.h"

namespace moondb {

// Records of one data type from one origin, in order.
struct WireStream {
  std::uint32_t data_type = 0;
  std::vector<proto::StoredRecord> records;
};

struct WireMission {
  std::string name;
  std::vector<WireStream> streams;                         // Streams in the order in which they are sent.
  std::vector<std::vector<TraversabilityMap>> rover_maps;  // Maps whose cells the streams contain, by rover.
};

// Makes a mission with three rovers, some 5,400 records, and 300 maps of 4 layers of 128 x 128 cells. The maps roll
// over one grid and have 1 % noise.
WireMission MakeRollingMission();

// Makes a mission with moondb_mission's generator, whose camera maps turn with the rover.
Result<WireMission> MakeSingleViewMission();

// Reads a recorded mission (model/mission.h). It gets the name of its folder.
Result<WireMission> ReadRecordedMission(const std::filesystem::path& folder);

}  // namespace moondb
