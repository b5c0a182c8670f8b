#include "apps/moonctl/command_context.h"

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "apps/common/json_writer.h"
#include "model/text.h"
#include "runtime/curve_keys.h"

namespace moondb {
namespace {

constexpr char kKeyVariable[] = "MOONDB_CLIENT_KEY";
constexpr std::chrono::milliseconds kShortTimeout(3000);
constexpr std::chrono::milliseconds kLongTimeout(600'000);

// Of a unit in milliseconds; 0: no such unit.
double ScaleOf(std::string_view unit) {
  if (unit == "ms") return 1;
  if (unit == "s") return 1000;
  if (unit == "m" || unit == "min") return 60'000;
  return unit == "h" ? 3'600'000 : 0;
}

}  // namespace

std::optional<std::chrono::milliseconds> ParseDuration(std::string_view text) {
  const std::size_t unit_at = text.find_first_not_of("0123456789.");
  const double scale = ScaleOf(unit_at == std::string_view::npos ? "s" : text.substr(unit_at));
  const auto number = ParseDouble(text.substr(0, unit_at));
  if (!number || scale == 0 || *number <= 0 || *number * scale > 86'400'000) return std::nullopt;
  return std::chrono::milliseconds(static_cast<std::int64_t>(*number * scale));
}

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
  if (via.empty()) return nullptr;
  auto team = Team();
  if (!team) return tl::unexpected(team.error());
  return AgentNamed((*team)->config, via);
}

Result<proto::RoleAssignment> CommandContext::Roles() {
  auto team = Team();
  if (!team) return tl::unexpected(team.error());
  auto through = Via();
  if (!through) return tl::unexpected(through.error());
  auto options = ClientOptions();
  if (!options) return tl::unexpected(options.error());
  return NewestRoles(**team, *options, *through);
}

Result<AgentClient> CommandContext::Connect(const std::string& name) {
  auto team = Team();
  if (!team) return tl::unexpected(team.error());
  auto named = AgentNamed((*team)->config, name);
  if (!named) return tl::unexpected(named.error());
  auto through = Via();
  if (!through) return tl::unexpected(through.error());
  auto options = ClientOptions();
  if (!options) return tl::unexpected(options.error());
  auto client = ConnectTo(**team, **named, *options, *through);
  if (!client) return tl::unexpected(client.error());
  if (*through != nullptr) {
    // That the one in between answers says nothing of the one that is meant.
    if (auto there = (*client)->Roles(); !there) return tl::unexpected(there.error());
  }
  return AgentClient{*named, std::move(*client)};
}

Result<std::vector<const proto::AgentConfig*>> CommandContext::ChosenAgents() {
  auto team = Team();
  if (!team) return tl::unexpected(team.error());
  if (auto through = Via(); !through) return tl::unexpected(through.error());
  if (!agent.empty()) {
    auto named = AgentNamed((*team)->config, agent);
    if (!named) return tl::unexpected(named.error());
    return std::vector{*named};
  }
  std::vector<const proto::AgentConfig*> agents;
  for (const proto::AgentConfig& configured : (*team)->config.agents()) agents.push_back(&configured);
  return agents;
}

Result<AgentClient> CommandContext::ConnectToChosenOrLeader() {
  if (!agent.empty()) return Connect(agent);
  auto team = Team();
  if (!team) return tl::unexpected(team.error());
  auto roles = Roles();
  if (!roles) return tl::unexpected(roles.error());
  if (roles->leader() == 0) return Fail(ErrorCode::kRefused, "nobody leads the team; see moonctl role set");
  auto leader = Connect(AgentName((*team)->config, roles->leader()));
  if (!leader) {
    leader.error().text += "; it leads the team: if it is lost, let the survivor lead by moonctl role set";
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

ExitCode CommandContext::Print(ExitCode code, std::string_view json, std::string_view text) const {
  const std::string_view shown = is_json ? json : text;
  if (!is_json) std::fputs(heading.c_str(), stdout);
  std::fwrite(shown.data(), 1, shown.size(), stdout);
  if (!shown.empty() && shown.back() != '\n') std::fputc('\n', stdout);
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return code;
  std::fprintf(stderr, "moonctl: the result cannot be written: %s\n", std::strerror(errno));
  return ExitCode::kFailed;
}

}  // namespace moondb
