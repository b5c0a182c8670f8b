// The simulated team's configuration, which differs from seed to seed: who fails over by itself, how batches are coded,
// what is kept. Plain functions.
#pragma once

#include "apps/moondb_sim/options.h"
#include "model/geometry.h"
#include "model/ids.h"
#include "proto/team.pb.h"
#include "runtime/team/signing_key.h"

namespace moondb::simulation {

// A custom type of the team with all actors, shared as `all`.
inline constexpr DataType kSample = 1001;
inline constexpr std::uint32_t kSampleBytesMax = 256;

// So many maps are merged in one seed of three, so that some of them find no room.
inline constexpr std::size_t kFewMaps = 8;

proto::TeamConfig MakeTeamConfig(const SimOptions& options);

// Returns the team with the policy `all` for kNote.
proto::TeamConfig KeepAllNotes(proto::TeamConfig team);

// With which an agent of a team with keys signs.
SigningKey SigningKeyOf(AgentId agent);

// Where a rover stands at its first node, as the team file has it and as it is; a base station, for ever.
Pose StartOf(AgentId agent, bool is_base_station);

}  // namespace moondb::simulation
