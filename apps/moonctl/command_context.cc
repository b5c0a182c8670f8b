#include "apps/moonctl/command_context.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "apps/common/json_writer.h"
#include "apps/moonctl/health.h"
#include "model/team_member.h"
#include "model/text.h"
#include "runtime/team/curve_keys.h"
#include "runtime/team/team_keys.h"

namespace moondb {
namespace {

constexpr char kKeyVariable[] = "MOONDB_CLIENT_KEY";
constexpr char kViaVariable[] = "MOONDB_VIA";
constexpr std::chrono::milliseconds kShortTimeout(3000);
constexpr std::chrono::milliseconds kLongTimeout(600'000);

}  // namespace

Result<std::chrono::milliseconds> ParseLeaseDuration(const std::string& text) {
  if (const auto duration = ParseDuration(text)) return *duration;
  return Fail(ErrorCode::kInvalid, "expected a duration of at most 24 h such as 40, 10m or 8h, got \"" + text + "\"",
              "--for");
}

Result<void> CommandContext::ParseTimeout() {
  if (timeout.empty()) return {};
  timeout_ = ParseDuration(timeout);
  if (timeout_) return {};
  return Fail(ErrorCode::kInvalid, "expected a duration such as 3s, 500ms or 2m, got \"" + timeout + "\"", "--timeout");
}

Result<std::string> CommandContext::SecretKey() {
  if (secret_key_) return *secret_key_;
  const char* from_environment = std::getenv(kKeyVariable);
  const bool is_option = !key_file.empty() || from_environment == nullptr;
  const std::string file = is_option ? key_file : from_environment;
  const auto key = file.empty() ? Result<std::string>(std::string()) : ReadSecretKey(file);
  if (!key) return Fail(ErrorCode::kInvalid, key.error().text, is_option ? "--key" : kKeyVariable);
  secret_key_ = *key;
  return key;
}

std::filesystem::path CommandContext::TeamPath() const {
  if (!team_path.empty()) return team_path;
  const char* from_environment = std::getenv("MOONDB_TEAM");
  return from_environment == nullptr ? "" : from_environment;
}

Result<const TeamFile*> CommandContext::Team() {
  if (team_) return &*team_;
  if (TeamPath().empty()) {
    return Fail(ErrorCode::kInvalid, "which team? Give -t team.yaml, or set MOONDB_TEAM");
  }
  auto read = ReadTeamFile(TeamPath());
  if (!read) return Fail(ErrorCode::kInvalid, read.error().text, read.error().field);
  team_ = std::move(*read);
  return &*team_;
}

Result<Client::Options> CommandContext::ClientOptions() {
  const auto key = SecretKey();
  if (!key) return tl::unexpected(key.error());
  Client::Options options;
  options.timeout = timeout_.value_or(kShortTimeout);
  options.secret_key = *key;
  options.long_timeout = timeout_.value_or(kLongTimeout);
  options.connect_timeout = std::min(options.timeout, std::chrono::milliseconds(1000));
  return options;
}

std::chrono::milliseconds CommandContext::WaitTimeout() const { return timeout_.value_or(kLongTimeout); }

Result<const proto::AgentConfig*> CommandContext::Via() {
  if (is_here_) return nullptr;
  const char* from_environment = std::getenv(kViaVariable);
  const bool is_option = !via.empty() || from_environment == nullptr;
  const std::string name = is_option ? via : from_environment;
  if (name.empty()) return nullptr;
  auto team = Team();
  if (!team) return tl::unexpected(team.error());
  auto named = MemberNamed((*team)->config, name);
  if (!named && !is_option) return Fail(named.error().code, named.error().text, kViaVariable);
  return named;
}

std::uint64_t CommandContext::ConfigHashOf(AgentId of) const {
  const auto hash = config_hashes_.find(of);
  return hash == config_hashes_.end() ? 0 : hash->second;
}

void CommandContext::ObserveConfigHash(const proto::AgentConfig& of, std::uint64_t hash) {
  const std::uint64_t known = std::exchange(config_hashes_[of.id()], hash);
  if (hash == 0 || hash == known || hash == team_->hash) return;
  std::fprintf(stderr, "moonctl: %s runs with another team file: %s\n", of.name().c_str(),
               OtherConfigText(hash, team_->hash).c_str());
}

// Prints on stderr, once per relay, that `by` relays requests. With --json, prints nothing: the document names the
// relays.
void CommandContext::ObserveRelay(const proto::AgentConfig& by) {
  if (std::find(relays_.begin(), relays_.end(), by.name()) != relays_.end()) return;
  relays_.push_back(by.name());
  if (!is_json) std::fprintf(stderr, "moonctl: requests are relayed by %s, over the radio\n", by.name().c_str());
}

void CommandContext::AddRemark(const std::string& text) {
  if (remarks_.insert(text).second) std::fprintf(stderr, "moonctl: %s\n", text.c_str());
}

Result<TeamReach*> CommandContext::Reach() {
  if (reach_) return reach_.get();
  auto team = Team();
  if (!team) return tl::unexpected(team.error());
  auto through = Via();
  if (!through) return tl::unexpected(through.error());
  auto options = ClientOptions();
  if (!options) return tl::unexpected(options.error());
  TeamReach::Options reach;
  reach.client = *std::move(options);
  reach.via = *through;
  reach.on_config_hash = [this](const proto::AgentConfig& of, std::uint64_t hash) { ObserveConfigHash(of, hash); };
  reach.on_relay = [this](const proto::AgentConfig& by) { ObserveRelay(by); };
  reach.on_remark = [this](const std::string& text) { AddRemark(text); };
  reach_ = std::make_unique<TeamReach>(**team, std::move(reach));
  return reach_.get();
}

Result<proto::RoleAssignment> CommandContext::Roles() {
  auto reach = Reach();
  if (!reach) return tl::unexpected(reach.error());
  return (*reach)->NewestRoles();
}

Result<AgentClient> CommandContext::Connect(const std::string& name) {
  auto reach = Reach();
  if (!reach) return tl::unexpected(reach.error());
  auto named = MemberNamed(team_->config, name);
  if (!named) return tl::unexpected(named.error());
  return (*reach)->Connect(**named);
}

Result<AgentClient> CommandContext::ConnectHere(const std::string& name) {
  auto reach = Reach();
  if (!reach) return tl::unexpected(reach.error());
  auto named = AgentNamed(team_->config, name);
  if (!named) return tl::unexpected(named.error());
  return (*reach)->ConnectHere(**named);
}

Result<std::vector<const proto::AgentConfig*>> CommandContext::ChosenAgents() {
  auto team = Team();
  if (!team) return tl::unexpected(team.error());
  if (auto through = Via(); !through) return tl::unexpected(through.error());
  if (!agent.empty()) {
    auto named = MemberNamed((*team)->config, agent);
    if (!named) return tl::unexpected(named.error());
    return std::vector{*named};
  }
  std::vector<const proto::AgentConfig*> agents;
  for (const proto::AgentConfig& configured : (*team)->config.agents()) {
    if (!configured.left()) agents.push_back(&configured);
  }
  return agents;
}

Result<const proto::AgentConfig*> CommandContext::ChosenOrOnlyHere() {
  const auto team = Team();
  if (!team) return tl::unexpected(team.error());
  if (!agent.empty()) return MemberNamed((*team)->config, agent);
  const proto::AgentConfig* only = nullptr;
  for (const proto::AgentConfig& configured : (*team)->config.agents()) {
    if (configured.left() || !HasSecretKey((*team)->config, (*team)->folder, configured)) continue;
    if (only != nullptr) {
      return Fail(ErrorCode::kInvalid, "the secret keys of several agents are here; name one: -a " + only->name(),
                  "--agent");
    }
    only = &configured;
  }
  if (only != nullptr) return only;
  return Fail(ErrorCode::kInvalid, "no agent's secret key is on this machine; name an agent: -a NAME", "--agent");
}

Result<AgentClient> CommandContext::ConnectToChosenOrLeader() {
  if (!agent.empty()) return Connect(agent);
  auto roles = Roles();
  if (!roles) return tl::unexpected(roles.error());
  return ConnectToLeaderOf(*roles);
}

Result<AgentClient> CommandContext::ConnectToLeaderOf(const proto::RoleAssignment& roles) {
  auto team = Team();
  if (!team) return tl::unexpected(team.error());
  if (roles.leader() == 0) return Fail(ErrorCode::kRefused, "the team has no leader; name one with moonctl role set");
  const std::string name = AgentName((*team)->config, roles.leader());
  if (HasLeft((*team)->config, roles.leader())) {
    return Fail(ErrorCode::kRefused,
                name + " leads the team, but has left it: name another leader with moonctl role set");
  }
  auto leader = Connect(name);
  // Suggest a new leader only if no other agent is connected to this leader. A connected leader is not lost.
  const proto::AgentConfig* named = FindAgent((*team)->config, static_cast<AgentId>(roles.leader()));
  if (!leader && IsUnreachable(leader.error()) && named != nullptr && !reach_->IsHeard(*named)) {
    leader.error().text += "; it is the leader: if it is lost, make the survivor the leader with moonctl role set";
  }
  return leader;
}

ExitCode CommandContext::Report(const Error& error) const {
  if (is_json) {
    JsonWriter json;
    json.BeginObject().Key("error").WriteError(error).EndObject();
    return Print(ExitCodeOf(error.code), json.text(), "");
  }
  std::fputs(heading.c_str(), stdout);
  std::fflush(stdout);
  std::fprintf(stderr, "moonctl: %s\n", ToString(error).c_str());
  return ExitCodeOf(error.code);
}

std::string CommandContext::WithVia(std::string_view json) const {
  const std::size_t end = json.rfind('}');
  if (relays_.empty() || end == std::string_view::npos || !json.starts_with('{')) return std::string(json);
  std::string names;
  for (const std::string& name : relays_) names += (names.empty() ? "" : ", ") + name;
  const bool is_first = json.find_first_not_of(" \n", 1) == end;
  JsonWriter value;
  value.String(names);
  return std::string(json.substr(0, end)) + (is_first ? "" : ",") + "\"via\":" + value.text() +
         std::string(json.substr(end));
}

ExitCode CommandContext::Print(ExitCode code, std::string_view json, std::string_view text) const {
  const std::string document = is_json ? WithVia(json) : "";
  const std::string_view shown = is_json ? document : text;
  if (!is_json) std::fputs(heading.c_str(), stdout);
  std::fwrite(shown.data(), 1, shown.size(), stdout);
  if (!shown.empty() && shown.back() != '\n') std::fputc('\n', stdout);
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return code;
  std::fprintf(stderr, "moonctl: the result cannot be written: %s\n", std::strerror(errno));
  return ExitCode::kFailed;
}

}  // namespace moondb
