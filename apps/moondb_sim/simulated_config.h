// Makes the simulated team's configuration, in which failover, batch codec, signing keys and retention differ from seed
// to seed. Free functions.
#pragma once

#include "apps/moondb_sim/options.h"
#include "model/geometry.h"
#include "model/ids.h"
#include "proto/team.pb.h"
#include "runtime/team/signing_key.h"

namespace moondb::simulation {

// Custom type of the team with all actors, shared with the policy `all`.
inline constexpr DataType kSample = 1001;
inline constexpr std::uint32_t kSampleBytesMax = 256;

// Limit of merged maps in one seed of three. It is so low that agents leave some maps out.
inline constexpr std::size_t kFewMaps = 8;

proto::TeamConfig MakeTeamConfig(const SimOptions& options);

// Returns the team with the policy `all` for kNote.
proto::TeamConfig KeepAllNotes(proto::TeamConfig team);

// Returns the key with which `agent` signs in a team with keys.
SigningKey SigningKeyOf(AgentId agent);

// Returns the pose of a rover at its first node, which is the same in the team file and in truth. For a base station,
// returns its permanent pose.
Pose StartOf(AgentId agent, bool is_base_station);

}  // namespace moondb::simulation
