// Makes simulated lunar missions in the format of model/mission.h: terrain, drives, odometry, ranges and local maps.
//
// The same options give the same mission, byte for byte, on one machine and build. Each part draws from its own random
// stream. Among the files that an agent may read, only the vertices of graph.pyfg contain the truth.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "apps/moondb_mission/drive.h"
#include "apps/moondb_mission/measurement.h"
#include "apps/moondb_mission/sensing.h"
#include "apps/moondb_mission/terrain.h"
#include "model/mission.h"

namespace moondb {

struct MissionOptions {
  std::uint64_t seed = 1;
  double minutes = 10;        // Duration; 1 to 600.
  double node_period_s = 10;  // 1 to 600. Each rover makes a node and a map once per period.
  int rover_count = 3;        // Number of rovers; 1 to 8.
  double start_sigma_m = 0.05;
  double start_sigma_rad = 0.01;
  TerrainOptions terrain;  // MakeMission draws base_m at random.
  OdometryOptions odometry;
  RangeOptions ranges;
  CameraOptions camera;
};

struct MadeMission {
  Terrain terrain;
  Mission mission;                      // Mission::folder is empty. The names of the map files are set.
  std::vector<TraversabilityMap> maps;  // One map for each entry of mission.maps.
};

// Makes a mission. kInvalid, with the option as field, if a number is outside the range of its option, or if there are
// more than 20000 maps.
Result<MadeMission> MakeMission(const MissionOptions& options);

// Writes the mission and its maps. kRefused if the folder is not empty. Other errors are those of WriteMission.
Result<void> WriteMadeMission(const MadeMission& made, const std::filesystem::path& folder);

}  // namespace moondb
