// The team's configuration: one YAML file, the same on every agent, checked before anything starts.
//
// Read into proto::TeamConfig by reflection; every error at once, each with its place and, for a misspelt word, a
// suggestion:  team.yaml:4:10: agents[1].id: expected an integer, got "two"
// yaml-cpp's errors of syntax stand alone.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "model/error.h"
#include "model/ids.h"
#include "model/keep_rule.h"
#include "proto/team.pb.h"
#include "proto/term.pb.h"

namespace moondb {

struct TeamFile {
  proto::TeamConfig config;      // Complete: defaults are filled in, policies too.
  std::filesystem::path folder;  // Where relative key files lie.
  std::uint64_t hash = 0;        // XXH64 of SerializeTeam; equal for files that mean the same.
};

// Error::text holds one error a line.
Result<TeamFile> ReadTeamFile(const std::filesystem::path& path);

// The same from text; `name` stands in errors.
Result<TeamFile> ParseTeamFile(const std::string& yaml, const std::string& name);

// The same bytes for teams that are equal, which SerializeAsString does not promise for maps.
std::string SerializeTeam(const proto::TeamConfig& team);

// Built-in and declared ones, in the order of their numbers.
std::vector<DataType> DataTypesOf(const proto::TeamConfig& team);

// What rovers send to the leader and the leader to the survivor, or the base station is sent, of a type; POLICY_NONE
// for one that the team does not know.
proto::Policy SharePolicyOf(const proto::TeamConfig& team, DataType type);
proto::Policy GroundPolicyOf(const proto::TeamConfig& team, DataType type);

// What stays at its origin of a type's superseded records; all where nothing of it is superseded.
KeepRule KeepRuleOf(const proto::TeamConfig& team, DataType type);

// The assignment of the file, as term 0.
proto::RoleAssignment InitialRoles(const proto::TeamConfig& team);

// Why `roles` cannot be, nor can ever have been: unknown agent, survivor = leader, a base station as either, no leader.
// kRefused, `field` is "leader" or "survivor".
Result<void> CheckRoles(const proto::TeamConfig& team, const proto::RoleAssignment& roles);

// The role of `agent` under `roles`; of one that has left none.
proto::Role RoleOf(const proto::TeamConfig& team, const proto::RoleAssignment& roles, AgentId agent);

// A team to begin with: `agent_count` agents on loopback ports from `first_port`, the last one a base station when
// there are at least two, written as commented YAML with CURVE keys beside it (secrets 0600).
// Refuses to overwrite anything.
Result<void> WriteInitialTeam(const std::filesystem::path& path, int agent_count, int first_port);

// The same for given agents: `team` holds names, addresses, kinds, start poses and antennas.
Result<void> WriteTeam(const std::filesystem::path& path, const proto::TeamConfig& team);

// ipc:// endpoint of an agent's clients: a socket in a folder of this user's, 0700, under $MOONDB_RUN_DIR,
// $XDG_RUNTIME_DIR/moondb or /tmp/moondb-UID. kInvalid if the path would exceed what a socket allows.
Result<std::string> ClientEndpoint(const TeamFile& team, const std::string& agent_name);

}  // namespace moondb
