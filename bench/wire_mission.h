// Whole missions as the records that a team shares, for wire_bench: maps, pose graph and states of all rovers.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "model/error.h"
#include "model/traversability_map.h"
#include "proto/record.pb.h"

namespace moondb {

// One origin's records of one data type, in order.
struct WireStream {
  std::uint32_t data_type = 0;
  std::vector<proto::StoredRecord> records;
};

struct WireMission {
  std::string name;
  std::vector<WireStream> streams;                         // In the order in which they are sent.
  std::vector<std::vector<TraversabilityMap>> rover_maps;  // The maps' cells again, by rover.
};

// Three rovers, 300 maps of 4 layers of 128 x 128 that roll over one grid with 1 % noise, and some 5,400 records.
WireMission MakeRollingMission();

// Of moondb_mission's generator: camera maps that turn with the rover.
Result<WireMission> MakeSingleViewMission();

// A recorded mission (model/mission.h), with the name of its folder.
Result<WireMission> ReadRecordedMission(const std::filesystem::path& folder);

}  // namespace moondb
