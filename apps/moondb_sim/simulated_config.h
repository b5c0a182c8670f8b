// Makes the simulated team's configuration. Failover, batch codec, signing keys and retention depend on the seed.
#pragma once

#include "apps/moondb_sim/options.h"
#include "model/geometry.h"
#include "model/ids.h"
#include "proto/team.pb.h"
#include "runtime/team/signing_key.h"

namespace moondb::simulation {

// Custom type of teams with SimulatedActors::kAll, shared with the policy `all`.
inline constexpr DataType kSample = 1001;
inline constexpr std::uint32_t kSampleBytesMax = 256;

// Maximum number of maps that a MergeActor merges, in one seed of three. So low that some maps are left out.
inline constexpr std::size_t kFewMaps = 8;

proto::TeamConfig MakeTeamConfig(const SimOptions& options);

// Returns `team` with the sharing policy `all` for kNote.
proto::TeamConfig KeepAllNotes(proto::TeamConfig team);

// Returns the key with which `agent` signs in a team with keys.
SigningKey SigningKeyOf(AgentId agent);

// Returns the agent's pose at its first node. The team file has the same pose. A base station stays at this pose.
Pose StartOf(AgentId agent, bool is_base_station);

}  // namespace moondb::simulation
