// CommandContext: the state that all commands of moonctl share: global options, team, connections to agents, output.
//
// With --json, stdout gets exactly one document, which is {"error": ...} if the command fails. Without it, stdout gets
// the results, and stderr gets errors and progress. Not thread-safe.
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

// Parses the value of a lease's --for, at most 24 h. If ParseDuration rejects it: kInvalid, with the field "--for" and
// an example.
Result<std::chrono::milliseconds> ParseLeaseDuration(const std::string& text);

// The T of a function `ask` that returns a Result<T>.
template <typename Ask>
using AnswerOf = typename std::invoke_result_t<Ask, Client&>::value_type;

class CommandContext {
 public:
  explicit CommandContext(std::filesystem::path program_folder) : program_folder_(std::move(program_folder)) {}

  // The command line fills in these members.
  std::string team_path;  // Empty: $MOONDB_TEAM.
  std::string agent;      // Empty: each command chooses the agent itself.
  std::string via;  // The agent that relays all requests. Empty: $MOONDB_VIA. If that is not set, moonctl connects to
                    // each agent directly if possible, otherwise through a reachable agent (apps/moonctl/team_reach.h).
  bool is_json = false;
  std::string key_file;              // The client's secret key. Empty: $MOONDB_CLIENT_KEY. If that is not set, no key.
  std::string timeout;               // Examples: "3s", "500ms", "2m". Empty: each command's default.
  std::string watch;                 // Seconds between two passes. Empty: one pass.
  std::function<ExitCode()> action;  // Runs the chosen command.

  // Printed above each result for people. --watch sets a new heading for each pass.
  std::string heading;

  // Parses `timeout`. Call it before any action.
  Result<void> ParseTimeout();
  // Restricts later calls to processes of this machine: no key is needed, and no request is relayed.
  void StayHere() {
    secret_key_ = "";
    is_here_ = true;
  }

  // Returns the team file, which is read once. Every error is kInvalid, because no command has started yet.
  Result<const TeamFile*> Team();
  std::filesystem::path TeamPath() const;
  const std::filesystem::path& program_folder() const { return program_folder_; }

  // The timeout is 3 s for short calls, and 600 s for long calls and for waiting, unless --timeout is given. Reads the
  // key once. kInvalid if that fails, with the option or variable that named the key file.
  Result<Client::Options> ClientOptions();
  std::chrono::milliseconds WaitTimeout() const;
  bool has_timeout() const { return timeout_.has_value(); }  // Returns true if --timeout was given.

  // Connects to the agent of that name. If another agent relays the requests, prints one line on stderr; with --json,
  // Print adds a field `via` to the document instead.
  Result<AgentClient> Connect(const std::string& name);
  Result<AgentClient> ConnectHere(const std::string& name);  // Connects directly, without a relay.
  bool is_relayed() const { return !relays_.empty(); }       // Returns true if another agent relayed a request.
  // Returns the assignment with the newest term among all agents that answer. kUnavailable if none answers.
  Result<proto::RoleAssignment> Roles();
  // Returns the hash of the agent's team file, as the agent last reported it. 0: not reported. If this hash differs
  // from the hash of this command's team file, one line on stderr reports it once.
  std::uint64_t ConfigHashOf(AgentId of) const;
  // Returns the agent given with -a, otherwise all agents that have not left the team. kInvalid if the team has no such
  // agent, kRefused if that agent has left.
  Result<std::vector<const proto::AgentConfig*>> ChosenAgents();
  // Calls `ask`, a Result<T>(Client&), for each chosen agent. Agents that cannot be reached have an entry in the
  // answers too. kInvalid if the key cannot be read.
  template <typename Ask>
  auto AskEach(Ask ask) -> Result<AgentAnswers<AnswerOf<Ask>>>;

  // Connects to the agent given with -a, otherwise to the leader by the newest term that any agent reports.
  Result<AgentClient> ConnectToChosenOrLeader();
  // Connects to the leader that `roles` names. kRefused if it names none.
  Result<AgentClient> ConnectToLeaderOf(const proto::RoleAssignment& roles);

  // Report, Done and Print write the outcome and return the exit code.
  ExitCode Report(const Error& error) const;
  ExitCode Done(std::string_view json, std::string_view text) const { return Print(ExitCode::kDone, json, text); }
  // Returns kFailed if stdout rejects the output (full disk, closed pipe).
  ExitCode Print(ExitCode code, std::string_view json, std::string_view text) const;

 private:
  Result<std::string> SecretKey();          // Empty: the client has no key.
  Result<const proto::AgentConfig*> Via();  // Null: no agent is fixed as relay.
  Result<TeamReach*> Reach();
  void NoteConfigHash(const proto::AgentConfig& of, std::uint64_t hash);
  void NoteRelay(const proto::AgentConfig& by);
  void NoteRemark(const std::string& text);
  std::string WithVia(std::string_view json) const;  // Adds the relays as `via` to the document.

  std::filesystem::path program_folder_;
  std::optional<std::chrono::milliseconds> timeout_;
  std::optional<std::string> secret_key_;  // Set after it was read.
  bool is_here_ = false;
  std::optional<TeamFile> team_;
  std::map<AgentId, std::uint64_t> config_hashes_;
  std::vector<std::string> relays_;  // Names of agents that relayed requests.
  std::set<std::string> remarks_;    // Lines already written to stderr.
  std::unique_ptr<TeamReach> reach_;
};

template <typename Ask>
auto CommandContext::AskEach(Ask ask) -> Result<AgentAnswers<AnswerOf<Ask>>> {
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
