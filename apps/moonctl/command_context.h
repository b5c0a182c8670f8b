// CommandContext: what every command of moonctl has at hand: the global options, the team, the agents, the output.
//
// With --json stdout holds exactly one document, {"error": ...} where a command fails. For people results go to stdout,
// errors and progress to stderr. One thread.
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

// Of a lease's --for, at most 24 h: kInvalid, with that field and an example, where ParseDuration gives nothing.
Result<std::chrono::milliseconds> ParseLeaseDuration(const std::string& text);

// The T of an `ask` that gives a Result<T>.
template <typename Ask>
using AnswerOf = typename std::invoke_result_t<Ask, Client&>::value_type;

class CommandContext {
 public:
  explicit CommandContext(std::filesystem::path program_folder) : program_folder_(std::move(program_folder)) {}

  // Filled in by the command line.
  std::string team_path;  // Empty: $MOONDB_TEAM.
  std::string agent;      // Empty: the command's own choice.
  std::string via;        // The agent through which all are asked; empty: $MOONDB_VIA, and without that each is asked
                          // itself where that can be, else through one that can (apps/moonctl/team_reach.h).
  bool is_json = false;
  std::string key_file;              // The client's secret key; empty: $MOONDB_CLIENT_KEY, and without that none.
  std::string timeout;               // "3s", "500ms", "2m"; empty: each command's default.
  std::string watch;                 // Seconds between two passes; empty: one pass.
  std::function<ExitCode()> action;  // Of the command that was chosen.

  // Stands above each result for people; a watch sets it anew for each pass.
  std::string heading;

  // Reads `timeout`; before any action.
  Result<void> ParseTimeout();
  // What follows is about processes of this machine: it needs no key, and asks nobody through another agent.
  void StayHere() {
    secret_key_ = "";
    is_here_ = true;
  }

  // The team file, read once. Every error is kInvalid: nothing was started.
  Result<const TeamFile*> Team();
  std::filesystem::path TeamPath() const;
  const std::filesystem::path& program_folder() const { return program_folder_; }

  // Timeouts: of short calls 3 s, of long ones and of waiting 600 s, unless --timeout says otherwise. The key is read
  // here, once: kInvalid, with the option or the variable that named its file.
  Result<Client::Options> ClientOptions();
  std::chrono::milliseconds WaitTimeout() const;
  bool has_timeout() const { return timeout_.has_value(); }  // --timeout was given.

  // Where somebody is asked through another agent, one line on stderr says so, and `via` in what Print puts out as
  // JSON.
  Result<AgentClient> Connect(const std::string& name);
  Result<AgentClient> ConnectHere(const std::string& name);  // Through nobody.
  bool is_relayed() const { return !relays_.empty(); }  // Somebody was asked through another agent, over the radio.
  // The assignment with the newest term among all agents that answer. kUnavailable if none does.
  Result<proto::RoleAssignment> Roles();
  // Of the agent's team file, as it said last; 0: it did not. Where that is another one than this command's, one line
  // on stderr says so, once.
  std::uint64_t ConfigHashOf(AgentId of) const;
  // The agent of -a, without it all who have not left the team. kInvalid for one that the team does not have, kRefused
  // for one that has left.
  Result<std::vector<const proto::AgentConfig*>> ChosenAgents();
  // Asks each of them by `ask`, a Result<T>(Client&); one that cannot be reached stands in the answers too.
  // kInvalid for a key that cannot be read.
  template <typename Ask>
  auto AskEach(Ask ask) -> Result<AgentAnswers<AnswerOf<Ask>>>;

  // The agent of -a; without it the leader, as the newest term of all who answer has it.
  Result<AgentClient> ConnectToChosenOrLeader();
  // kRefused where these name no leader.
  Result<AgentClient> ConnectToLeaderOf(const proto::RoleAssignment& roles);

  // Say what came out, and give the exit code back.
  ExitCode Report(const Error& error) const;
  ExitCode Done(std::string_view json, std::string_view text) const { return Print(ExitCode::kDone, json, text); }
  // kFailed where stdout takes no more: a full disk, a closed pipe.
  ExitCode Print(ExitCode code, std::string_view json, std::string_view text) const;

 private:
  Result<std::string> SecretKey();          // Empty: none.
  Result<const proto::AgentConfig*> Via();  // Null: each agent is asked itself.
  Result<TeamReach*> Reach();
  void NoteConfigHash(const proto::AgentConfig& of, std::uint64_t hash);
  void NoteRelay(const proto::AgentConfig& by);
  void NoteRemark(const std::string& text);
  std::string WithVia(std::string_view json) const;  // The document, with through whom others were asked.

  std::filesystem::path program_folder_;
  std::optional<std::chrono::milliseconds> timeout_;
  std::optional<std::string> secret_key_;  // Once it was read.
  bool is_here_ = false;
  std::optional<TeamFile> team_;
  std::map<AgentId, std::uint64_t> config_hashes_;
  std::vector<std::string> relays_;  // Names of agents through which others were asked.
  std::set<std::string> remarks_;    // What was written to stderr already.
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
