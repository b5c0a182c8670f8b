// Makes simulated lunar missions in the format of model/mission.h: terrain, drives, odometry, ranges and local maps.
//
// The same options give the same mission, byte for byte, on one machine and build; each part draws from a stream of its
// own. Nothing that an agent may read holds the truth but the vertices of graph.pyfg.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "apps/moondb_mission/drive.h"
#include "apps/moondb_mission/measurement.h"
#include "apps/moondb_mission/sensing.h"
#include "apps/moondb_mission/terrain.h"
#include "model/map_picture.h"
#include "model/mission.h"

namespace moondb {

struct MissionOptions {
  std::uint64_t seed = 1;
  double minutes = 10;        // 1 to 600.
  double node_period_s = 10;  // 1 to 600. A node and a map each period and rover.
  int rover_count = 3;        // 1 to 8.
  double start_sigma_m = 0.05;
  double start_sigma_rad = 0.01;
  TerrainOptions terrain;  // base_m is drawn.
  OdometryOptions odometry;
  RangeOptions ranges;
  CameraOptions camera;
};

struct MadeMission {
  Terrain terrain;
  Mission mission;                      // Without a folder; maps' files are named.
  std::vector<TraversabilityMap> maps;  // One each for mission.maps.
};

// kInvalid with the option named as field: a number outside the range that its option states, or more than 20000 maps.
Result<MadeMission> MakeMission(const MissionOptions& options);

// Writes the mission and its maps. kRefused if the folder holds anything already; else as WriteMission.
Result<void> WriteMadeMission(const MadeMission& made, const std::filesystem::path& folder);

// The terrain with the rovers' true ways on it.
Image DrawMission(const MadeMission& made, const std::string& caption);

}  // namespace moondb
