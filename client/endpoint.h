// Finds the socket of an agent of this user on this machine, whatever environment variables the agent was started with.
//
//   const auto endpoint = FindEndpoint({.team = "moon", .team_id = "4f2a91c0...", .agent = "rover1"});
//   auto client = Client::Connect(*endpoint, "rover1", options);
//
// The names stand in the team file, which the program reads by itself.
#pragma once

#include <filesystem>
#include <string>

#include "model/client_endpoint.h"
#include "model/error.h"

namespace moondb {

// Name of the file in an agent's data folder that holds the endpoint of the process that uses the folder.
inline constexpr char kEndpointFile[] = "agent.endpoint";

// Returns the content of `agent.endpoint` in an agent's data folder. Empty: the file is missing or empty.
std::string ReadEndpoint(const std::filesystem::path& data_folder);

struct EndpointSearch {
  std::string endpoint;     // The endpoint (ipc://...) at which a process listens. Empty: no process listens.
  bool has_socket = false;  // A socket of the agent exists, although perhaps nobody listens.
  std::string why;          // The reason why no process listens.
};

// Tries the endpoint `reported` (ReadEndpoint) if it is not empty, then the agent's socket in each of RunFolders().
// Skips folders to which other users can write. Returns kInvalid if no process listens and the first of RunFolders()
// cannot be used, because other users can write to it or its path is too long.
Result<EndpointSearch> SearchEndpoint(const AgentOfTeam& agent, const std::string& reported = "");

// Returns the endpoint found by SearchEndpoint, kUnavailable if no process listens, or the errors of SearchEndpoint.
// `data_folder`: the agent's data folder; empty: unknown.
Result<std::string> FindEndpoint(const AgentOfTeam& agent, const std::filesystem::path& data_folder = {});

}  // namespace moondb
