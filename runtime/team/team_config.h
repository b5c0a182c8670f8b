// The team's configuration: one YAML file, the same on every agent, checked before anything starts.
//
// The file is read into proto::TeamConfig by reflection. All errors are reported together, each with its place and, for
// a misspelt word, a suggestion:
//   team.yaml:4:10: agents[1].id: expected an integer, got "two"
// If the file has a YAML syntax error, only that error is reported.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "model/client_endpoint.h"
#include "model/error.h"
#include "model/ids.h"
#include "model/keep_rule.h"
#include "proto/team.pb.h"
#include "proto/term.pb.h"

namespace moondb {

struct TeamFile {
  proto::TeamConfig config;      // The configuration with all defaults and policies filled in.
  std::filesystem::path folder;  // Relative paths of key files are relative to this folder.
  // XXH64 of the configuration, equal for files with the same meaning. Additions count only where they differ from
  // their defaults (TakeAdditions).
  std::uint64_t hash = 0;
};

// Reads a team file. Returns kNotFound if the file is missing, otherwise kInvalid on error. Error::text holds one error
// per line.
Result<TeamFile> ReadTeamFile(const std::filesystem::path& path);

// Parses the text `yaml` by the rules of ReadTeamFile, but checks no key files. `name` is the file name in error
// messages.
Result<TeamFile> ParseTeamFile(const std::string& yaml, const std::string& name);

// Returns the built-in and custom types, in the order of their numbers.
std::vector<DataType> DataTypesOf(const proto::TeamConfig& team);

// SharePolicyOf returns the policy under which rovers share a type with the leader, and the leader shares it with the
// survivor. GroundPolicyOf returns the policy under which a type is shared with the base station, and RoversPolicyOf
// the policy under which the leader shares all agents' records of a type with all rovers. All three return POLICY_NONE
// for a type that the team does not have.
proto::Policy SharePolicyOf(const proto::TeamConfig& team, DataType type);
proto::Policy GroundPolicyOf(const proto::TeamConfig& team, DataType type);
proto::Policy RoversPolicyOf(const proto::TeamConfig& team, DataType type);

// Returns how long an origin keeps superseded records of a type. Returns `all` if records of the type are never
// superseded.
KeepRule KeepRuleOf(const proto::TeamConfig& team, DataType type);

// Returns the role assignment of the team file, with term 0.
proto::RoleAssignment InitialRoles(const proto::TeamConfig& team);

// Returns kRefused if `roles` names an unknown agent, no leader, the same agent as leader and survivor, or a base
// station in either role. Agents that have left the team are allowed, because older assignments name them. The error's
// field is "leader" or "survivor".
Result<void> CheckRoles(const proto::TeamConfig& team, const proto::RoleAssignment& roles);

// Returns the role of `agent` under `roles`; ROLE_UNSPECIFIED if `agent` is unknown or has left the team.
proto::Role RoleOf(const proto::TeamConfig& team, const proto::RoleAssignment& roles, AgentId agent);

// Writes a new team as commented YAML, with key files beside it (secrets with mode 0600). The `agent_count` agents use
// loopback ports from `first_port`. If there are at least two agents, the last one is a base station. Never overwrites
// a file.
Result<void> WriteInitialTeam(const std::filesystem::path& path, int agent_count, int first_port);

// Writes files like WriteInitialTeam, for the agents in `team`, which holds names, addresses, kinds, start poses and
// antennas.
Result<void> WriteTeam(const std::filesystem::path& path, const proto::TeamConfig& team);

// Returns the names by which a client finds the agent's socket.
AgentOfTeam AgentOf(const TeamFile& team, const std::string& agent_name);

// Returns the ipc:// endpoint for an agent's clients, in the first of RunFolders(). Errors are those of
// ClientEndpointIn.
Result<std::string> ClientEndpoint(const TeamFile& team, const std::string& agent_name);

}  // namespace moondb
