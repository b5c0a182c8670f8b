// Whole missions in the form of the records that a team shares, for wire_bench: maps, pose graph and states of all
// rovers.
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
  std::vector<std::vector<TraversabilityMap>> rover_maps;  // The maps whose cells are in the streams, by rover.
};

// Makes a mission with three rovers, some 5,400 records, and 300 maps of 4 layers of 128 x 128 cells. The maps roll
// over one grid and have 1 % noise.
WireMission MakeRollingMission();

// Makes a mission with the generator of moondb_mission. Its camera maps are aligned with the rover, not with the world.
Result<WireMission> MakeSingleViewMission();

// Reads a recorded mission (model/mission.h). The name of the mission is that of its folder.
Result<WireMission> ReadRecordedMission(const std::filesystem::path& folder);

}  // namespace moondb
