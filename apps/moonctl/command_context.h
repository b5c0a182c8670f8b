// CommandContext: the global options, the team file, the connections to agents and the output of a moonctl command.
//
// With --json, stdout gets exactly one document, which is {"error": ...} if the command fails. Without --json, stdout
// gets the results, and stderr gets errors and progress. Not thread-safe.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "apps/common/team_clients.h"
#include "apps/moonctl/agent_answers.h"
#include "apps/moonctl/exit_code.h"
#include "apps/moonctl/team_reach.h"
#include "client/client.h"
#include "model/duration.h"
#include "runtime/team/team_config.h"

namespace moondb {

// Parses a lease duration of at most 24 h (the value of --for). If `text` is not such a duration, returns kInvalid with
// the field "--for" and an example.
Result<std::chrono::milliseconds> ParseLeaseDuration(const std::string& text);

// The type T, for a function of type `Ask` that takes a Client& and returns a Result<T>.
template <typename Ask>
using AnswerOf = typename std::invoke_result_t<Ask, Client&>::value_type;

class CommandContext {
 public:
  explicit CommandContext(std::filesystem::path program_folder) : program_folder_(std::move(program_folder)) {}

  // The command line fills in these members.
  std::string team_path;  // Path of the team file. Empty: $MOONDB_TEAM.
  std::string agent;      // The agent given with -a. Empty: each command chooses an agent.
  // The agent that relays all requests. Empty: the agent in $MOONDB_VIA. If that variable is not set, TeamReach chooses
  // a relay for each agent that it cannot reach directly.
  std::string via;
  bool is_json = false;
  std::string key_file;              // File of the client's secret key. Empty: $MOONDB_CLIENT_KEY, or no key.
  std::string timeout;               // Examples: "3s", "500ms", "2m". Empty: each command's default.
  std::string watch;                 // Seconds between two runs of the command. Empty: a single run.
  std::function<ExitCode()> action;  // Runs the chosen command.

  // Printed above each result, except with --json. --watch sets a new heading for each run of the command.
  std::string heading;

  // Parses `timeout`. Call before `action`. Returns kInvalid, with the field "--timeout", if the text is no duration.
  Result<void> ParseTimeout();
  // Restricts later calls to agents on this machine: the client uses no key, and no agent relays requests.
  void StayHere() {
    secret_key_ = "";
    is_here_ = true;
  }

  // Returns the team file, which the first call reads. Every error is kInvalid.
  Result<const TeamFile*> Team();
  std::filesystem::path TeamPath() const;
  const std::filesystem::path& program_folder() const { return program_folder_; }

  // Returns the client's key and timeouts. Without --timeout, the timeouts are 3 s for short calls and 600 s for long
  // calls. The first call reads the key file. Returns kInvalid, with the option or variable that names the key file, if
  // the key cannot be read.
  Result<Client::Options> ClientOptions();
  std::chrono::milliseconds WaitTimeout() const;             // --timeout, or 600 s by default.
  bool has_timeout() const { return timeout_.has_value(); }  // Returns true if --timeout was given.

  // Connects to the agent called `name`, if necessary through a relay. Prints the relay's name on stderr, or with
  // --json adds the name to the document as `via`.
  Result<AgentClient> Connect(const std::string& name);
  Result<AgentClient> ConnectHere(const std::string& name);  // Connects directly, without a relay.
  // Returns the agent given with -a, otherwise the only agent whose secret key is on this machine. Returns kInvalid if
  // the team has no such agent, or if the secret keys of none or of several agents are here; kRefused if it has left.
  Result<const proto::AgentConfig*> ChosenOrOnlyHere();
  bool is_relayed() const { return !relays_.empty(); }  // Returns true if another agent relayed a request.
  // Returns the role assignment with the newest term among all agents that answer. Errors are as for
  // TeamReach::NewestRoles.
  Result<proto::RoleAssignment> Roles();
  // Returns the hash of the agent's team file that the agent last reported. 0: the agent has reported no hash.
  std::uint64_t ConfigHashOf(AgentId of) const;
  // Returns the agent given with -a, otherwise all agents that have not left the team. kInvalid if the team has no such
  // agent, kRefused if that agent has left.
  Result<std::vector<const proto::AgentConfig*>> ChosenAgents();
  // Calls `ask`, which takes a Client& and returns a Result<T>, for each of ChosenAgents(). The entry of an agent that
  // cannot be reached is an error. Returns kInvalid if the key cannot be read.
  template <typename Ask>
  auto CallEach(Ask ask) -> Result<AgentAnswers<AnswerOf<Ask>>>;

  // Connects to the agent given with -a, otherwise to the leader in the assignment with the newest term that any agent
  // reports.
  Result<AgentClient> ConnectToChosenOrLeader();
  // Connects to the leader in `roles`. Returns kRefused if `roles` has no leader, or if the leader has left the team.
  Result<AgentClient> ConnectToLeaderOf(const proto::RoleAssignment& roles);

  // Report, Done and Print write the outcome of the command and return its exit code.
  ExitCode Report(const Error& error) const;
  ExitCode Done(std::string_view json, std::string_view text) const { return Print(ExitCode::kDone, json, text); }
  // Returns kFailed if stdout rejects the output (full disk, closed pipe).
  ExitCode Print(ExitCode code, std::string_view json, std::string_view text) const;

 private:
  Result<std::string> SecretKey();          // Empty: the client has no key.
  Result<const proto::AgentConfig*> Via();  // The relay chosen by the user. Null: none.
  Result<TeamReach*> Reach();
  void ObserveConfigHash(const proto::AgentConfig& of, std::uint64_t hash);
  void ObserveRelay(const proto::AgentConfig& by);
  void AddRemark(const std::string& text);
  std::string WithVia(std::string_view json) const;  // Adds the names in `relays_` as `via` to the document.

  std::filesystem::path program_folder_;
  std::optional<std::chrono::milliseconds> timeout_;
  std::optional<std::string> secret_key_;  // The client's secret key, once it has been read.
  bool is_here_ = false;
  std::optional<TeamFile> team_;
  std::map<AgentId, std::uint64_t> config_hashes_;
  std::vector<std::string> relays_;  // Names of agents that relayed requests.
  std::set<std::string> remarks_;    // Lines already written to stderr.
  std::unique_ptr<TeamReach> reach_;
};

template <typename Ask>
auto CommandContext::CallEach(Ask ask) -> Result<AgentAnswers<AnswerOf<Ask>>> {
  const auto agents = ChosenAgents();
  if (!agents) return tl::unexpected(agents.error());
  if (auto key = SecretKey(); !key) return tl::unexpected(key.error());
  AgentAnswers<AnswerOf<Ask>> answers;
  for (const proto::AgentConfig* chosen : *agents) {
    const auto connected = Connect(chosen->name());
    answers.push_back({chosen, connected ? ask(*connected->client) : tl::unexpected(connected.error())});
  }
  return answers;
}

}  // namespace moondb
