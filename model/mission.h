// Reads and writes mission folders (agents.csv, graph.pyfg, maps.csv, maps/*.png), the format of recorded missions and
// of the project's own generator. Values are in the frame `map`, in metres and radians.
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
  char letter = 0;  // Letter in the keys of the agent's nodes in graph.pyfg.
  Pose start;       // A rover's known start pose, or a base station's pose.
  double start_sigma_m = 0;
  double start_sigma_rad = 0;
  Eigen::Vector3d antenna_m = Eigen::Vector3d::Zero();  // Position of the antenna in the body's frame.
};

struct MissionMap {
  std::string id;  // Name of the map: "A17".
  AgentId agent = 0;
  std::int64_t timestamp_ns = 0;
  NodeKey node;
  Pose node_from_map;
  int layers = 0;
  int cells_per_side = 0;
  double finest_resolution_m = 0;
  std::filesystem::path file;  // Path relative to the mission's folder.
};

struct Mission {
  std::filesystem::path folder;
  std::vector<MissionAgent> agents;
  PoseGraph graph;  // Nodes have raw poses (start and odometry); a base station has one node, with index 0.
  std::map<NodeKey, Pose> truth;  // True map_from_node of all agents. Only for scoring; no agent sees it.
  std::vector<MissionMap> maps;   // Sorted by timestamp.
};

// Reads a mission, without the pictures of its maps (see ReadMissionMap). Fails with kNotFound if a file is missing,
// and with kInvalid and the field "file:line" if a file is malformed:
//   - agents.csv or maps.csv: a wrong heading, a number out of range, a duplicate id, name, key or map, an unknown
//     agent or node, or the file of a map outside of the folder;
//   - graph.pyfg: an error of ReadPyfg, a 2-D graph, a key of no agent, odometry between two agents, or a node of a
//     rover that odometry does not reach. Only errors of ReadPyfg name a line; the other errors name the key.
Result<Mission> ReadMission(const std::filesystem::path& folder);

// Returns the ids of the rovers, in the order of the agents.
std::vector<AgentId> RoverIds(const Mission& mission);

// Returns null if no agent has this id.
const MissionAgent* FindAgent(const Mission& mission, AgentId id);

// Reads the grids of one map from its picture. Fails like ReadPng. Fails with kInvalid if the picture is not gray, its
// size does not fit the layers of `map`, or a pixel is neither 254 (free), 0 (hazard) nor 205 (unknown).
Result<TraversabilityMap> ReadMissionMap(const Mission& mission, const MissionMap& map);

// Creates the folder and writes agents.csv, graph.pyfg and maps.csv. The vertices of graph.pyfg are the true poses in
// `mission.truth`; fails with kInvalid if a node has no true pose. Raw poses are not written, because start and
// odometry determine them.
Result<void> WriteMission(const Mission& mission, const std::filesystem::path& folder);

// Writes the picture of one map: its layers from top to bottom, finest first. Fails with kInvalid unless all layers
// have the same width.
Result<void> WriteMissionMap(const std::filesystem::path& file, const TraversabilityMap& map);

}  // namespace moondb
