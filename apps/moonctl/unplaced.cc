#include "apps/moonctl/unplaced.h"

#include "apps/common/table.h"
#include "model/agent_name.h"

namespace moondb {
namespace {

std::string MapsText(double map_count) {
  if (map_count == 0) return "no map";
  return FormatCount(map_count, "map waits", "maps wait");
}

}  // namespace

std::string CoincidingText(const proto::TeamConfig& team, AgentId rover, AgentId other) {
  return "the start of " + AgentName(team, rover) + " lies within one footprint of the start of " +
         AgentName(team, other) + " and is ignored: measure both starts, and enter them in the team file";
}

std::string UnplacedNames(const proto::TeamConfig& team, const UnplacedRovers& unplaced) {
  std::string names;
  for (const proto::UnplacedRover& rover : unplaced) {
    names += (names.empty() ? "" : ", ") + AgentName(team, rover.agent_id()) + " (" + MapsText(rover.map_count()) + ")";
  }
  return names;
}

std::string UnplacedText(const proto::TeamConfig& team, AgentId frame_of, const UnplacedRovers& unplaced) {
  std::string text;
  if (frame_of != 0) {
    text += AgentName(team, frame_of) + ": not placed in the team's map; this is its own map, in its own frame; " +
            kHowToPlace + "\n";
  }
  for (const proto::UnplacedRover& rover : unplaced) {
    text +=
        AgentName(team, rover.agent_id()) + ": not placed, " + MapsText(rover.map_count()) + "; " + kHowToPlace + "\n";
  }
  return text;
}

std::string CutText(const proto::TeamConfig& team, const google::protobuf::RepeatedPtrField<proto::CutRover>& cut) {
  std::string text;
  for (const proto::CutRover& rover : cut) {
    if (rover.map_count() == 0) continue;
    text += AgentName(team, rover.agent_id()) + ": " + MapsText(rover.map_count()) +
            " for the next solve, because from node " + std::to_string(rover.first_index()) +
            " on the odometry is not connected to the last solve; to place the maps: moonctl graph optimize\n";
  }
  return text;
}

}  // namespace moondb
