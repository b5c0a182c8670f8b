// Texts about rovers whose maps wait: they are not placed in the team's map, or a solve is due. Thread-safe.
#pragma once

#include <string>

#include "model/ids.h"
#include "proto/map.pb.h"
#include "proto/team.pb.h"

namespace moondb {

using UnplacedRovers = google::protobuf::RepeatedPtrField<proto::UnplacedRover>;

// The next step for an operator whose rover is not placed.
inline constexpr char kHowToPlace[] =
    "give it a start in the team file, drive it through places that another robot has seen, "
    "or insert two GNSS priors a few metres apart";

// Says that the start of `rover` does not count, because it lies within one footprint of the start of `other`.
std::string CoincidingText(const proto::TeamConfig& team, AgentId rover, AgentId other);

// Returns "rover2 (40 maps wait), rover3 (no map)".
std::string UnplacedNames(const proto::TeamConfig& team, const UnplacedRovers& unplaced);

// Returns one line per rover that is not placed, with the next step. `frame_of`: the unplaced rover whose maps alone
// are shown, in its own frame; 0 if there is none.
std::string UnplacedText(const proto::TeamConfig& team, AgentId frame_of, const UnplacedRovers& unplaced);

// Returns one line per rover whose newer maps wait for the next solve.
std::string CutText(const proto::TeamConfig& team, const google::protobuf::RepeatedPtrField<proto::CutRover>& cut);

}  // namespace moondb
