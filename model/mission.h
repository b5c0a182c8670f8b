// Mission folders: agents.csv, graph.pyfg, maps.csv, maps/*.png. What recorded missions and the project's own
// generator have in common. Frame `map`, metres, radians.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "model/error.h"
#include "model/pose_graph.h"
#include "model/traversability_map.h"

namespace moondb {

struct MissionAgent {
  AgentId id = 0;
  std::string name;
  bool is_base_station = false;
  char letter = 0;  // Of its keys in graph.pyfg.
  Pose start;       // What the agent knows of itself at the beginning; the body's pose of a base station.
  double start_sigma_m = 0;
  double start_sigma_rad = 0;
  Eigen::Vector3d antenna_m = Eigen::Vector3d::Zero();  // In the body's frame.
};

struct MissionMap {
  std::string id;  // "A17"
  AgentId agent = 0;
  std::int64_t timestamp_ns = 0;
  NodeKey node;
  Pose node_from_map;
  int layers = 0;
  int cells_per_side = 0;
  double finest_resolution_m = 0;
  std::filesystem::path file;  // Relative to the folder.
};

struct Mission {
  std::filesystem::path folder;
  std::vector<MissionAgent> agents;
  PoseGraph graph;                // Raw poses composed from start and odometry; a base station is one node, index 0.
  std::map<NodeKey, Pose> truth;  // map_from_node, rovers and base. For scoring only: never fed to an agent.
  std::vector<MissionMap> maps;   // By stamp.
};

// Fails with "file:line" as the error's field. kNotFound: a file is missing. kInvalid: agents.csv or maps.csv is not of
// that form (a wrong heading, a number out of range, a doubled id, name, key or map, an agent or node that is nowhere,
// a map's file outside the folder); graph.pyfg as in ReadPyfg, or 2-D, or with a key of no agent, odometry between two
// agents, or a rover's node that odometry does not reach (these name the key, not the line).
// Maps' pictures are read later, one by one.
Result<Mission> ReadMission(const std::filesystem::path& folder);

// The rovers' ids, in the order of the agents.
std::vector<AgentId> RoverIds(const Mission& mission);

// Null for an id that is no agent's.
const MissionAgent* FindAgent(const Mission& mission, AgentId id);

// The grids of one map, from its picture; sizes are checked against `map`. Errors as in ReadPng, and kInvalid for a
// picture that is not gray or of another size, or a pixel that is neither 254 (free), 0 (hazard) nor 205 (unknown).
Result<TraversabilityMap> ReadMissionMap(const Mission& mission, const MissionMap& map);

// Writes agents.csv, graph.pyfg and maps.csv, and makes the folder. `mission.truth` becomes the file's vertices, so
// every node needs one (kInvalid otherwise); the nodes' raw poses are not written, since start and odometry say the
// same.
Result<void> WriteMission(const Mission& mission, const std::filesystem::path& folder);

// Writes one map's picture: layers stacked from top to bottom, finest first. kInvalid unless all layers have one width.
Result<void> WriteMissionMap(const std::filesystem::path& file, const TraversabilityMap& map);

}  // namespace moondb
