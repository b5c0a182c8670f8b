#include "runtime/team/team_config.h"

#include <xxhash.h>

#include <fstream>
#include <map>

#include "model/custom_types.h"
#include "model/team_member.h"
#include "runtime/team/curve_keys.h"
#include "runtime/team/field_rules.h"
#include "runtime/team/team_check.h"
#include "runtime/team/trusted_file.h"
#include "runtime/team/yaml_reader.h"

namespace moondb {
namespace {

constexpr std::size_t kTeamFileBytesMax = 1'000'000;

// Checks the key files that the team file names, and adds their errors to `errors`.
void CheckKeyFiles(const TeamFile& team, const Places& places, PlacedErrors* errors) {
  std::map<std::string, std::string> owners;
  for (int i = 0; i < team.config.agents_size(); ++i) {
    const proto::AgentConfig& agent = team.config.agents(i);
    if (agent.key().empty()) continue;
    const std::string field = "agents[" + std::to_string(i) + "].key";
    const Result<std::string> key = ReadPublicKey(team.folder / agent.key());
    if (!key) {
      errors->Add(PlaceOf(places, field), field, key.error().text);
    } else if (const auto [owner, is_new] = owners.emplace(*key, agent.name()); !is_new) {
      errors->Add(PlaceOf(places, field), field, "is the key of " + owner->second + " too");
    }
  }
  // A key must not be used both for connections and for signatures.
  for (int i = 0; i < team.config.agents_size(); ++i) {
    const auto owner = owners.find(team.config.agents(i).signing_key());
    if (owner == owners.end()) continue;
    const std::string field = "agents[" + std::to_string(i) + "].signing_key";
    errors->Add(PlaceOf(places, field), field,
                "is the CURVE key of " + owner->second + ": expected a signing key, which is a different key");
  }
}

Result<TeamFile> Parse(const std::string& yaml, const std::string& name, const std::filesystem::path* folder) {
  PlacedErrors errors(name);
  if (yaml.size() > kTeamFileBytesMax) {
    errors.Add({}, "", "the file is larger than 1 MB");
    return Fail(ErrorCode::kInvalid, errors.Text());
  }
  TeamFile team;
  Places places;
  ReadYaml(yaml, &team.config, &places, &errors);
  if (!places.empty() || errors.empty()) CheckTeam(team.config, places, &errors);
  if (folder != nullptr) {
    team.folder = *folder;
    if (!team.config.insecure()) CheckKeyFiles(team, places, &errors);
  }
  if (!errors.empty()) return Fail(ErrorCode::kInvalid, errors.Text());
  FillDefaults(places, &team.config);
  proto::TeamConfig hashed = team.config;
  const std::string additions = TakeAdditions(&hashed);
  const std::string bytes = SerializeInOrder(hashed) + additions;
  team.hash = XXH64(bytes.data(), bytes.size(), 0);
  return team;
}

using Policies = google::protobuf::Map<std::string, proto::Policy>;

proto::Policy BuiltInPolicyOf(const Policies& policies, DataType type) {
  const auto policy = policies.find(DataTypeName(type));
  return policy == policies.end() || policy->second == proto::POLICY_UNSPECIFIED ? proto::POLICY_NONE : policy->second;
}

}  // namespace

Result<TeamFile> ReadTeamFile(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) {
    // `error` is set if the existence is unknown, for example because this process may not enter the folder.
    if (error) return Fail(ErrorCode::kInvalid, path.string() + ": " + error.message());
    return Fail(ErrorCode::kNotFound, path.string() + ": no such file");
  }
  if (!std::filesystem::is_regular_file(path, error)) {
    return Fail(ErrorCode::kInvalid, path.string() + ": not a regular file");
  }
  if (const Result<void> trusted = CheckTrusted(path); !trusted) return tl::unexpected(trusted.error());
  std::ifstream file(path, std::ios::binary);
  std::string yaml(kTeamFileBytesMax + 1, '\0');
  file.read(yaml.data(), static_cast<std::streamsize>(yaml.size()));
  if (file.bad() || (file.fail() && !file.eof())) {
    return Fail(ErrorCode::kInvalid, path.string() + ": cannot be read");
  }
  yaml.resize(static_cast<std::size_t>(file.gcount()));
  const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
  return Parse(yaml, path.string(), &folder);
}

Result<TeamFile> ParseTeamFile(const std::string& yaml, const std::string& name) { return Parse(yaml, name, nullptr); }

std::vector<DataType> DataTypesOf(const proto::TeamConfig& team) {
  std::vector<DataType> types = BuiltInDataTypes();
  for (const proto::CustomType& type : team.custom_types()) types.push_back(type.id());
  return types;
}

proto::Policy SharePolicyOf(const proto::TeamConfig& team, DataType type) {
  const proto::CustomType* custom = FindCustomType(team.custom_types(), type);
  return custom == nullptr ? BuiltInPolicyOf(team.share(), type) : custom->share();
}

proto::Policy GroundPolicyOf(const proto::TeamConfig& team, DataType type) {
  const proto::CustomType* custom = FindCustomType(team.custom_types(), type);
  return custom == nullptr ? BuiltInPolicyOf(team.ground(), type) : custom->ground();
}

proto::Policy RoversPolicyOf(const proto::TeamConfig& team, DataType type) {
  const proto::CustomType* custom = FindCustomType(team.custom_types(), type);
  return custom == nullptr ? BuiltInPolicyOf(team.rovers(), type) : custom->rovers();
}

KeepRule KeepRuleOf(const proto::TeamConfig& team, DataType type) {
  if (const proto::CustomType* custom = FindCustomType(team.custom_types(), type)) {
    return ParseKeepRule(custom->keep()).value_or(KeepRule{});
  }
  const auto keep = team.keep().find(DataTypeName(type));
  return keep == team.keep().end() ? KeepRule{} : ParseKeepRule(keep->second).value_or(KeepRule{});
}

proto::RoleAssignment InitialRoles(const proto::TeamConfig& team) {
  proto::RoleAssignment roles;
  if (const auto* leader = FindAgent(team, team.roles().leader())) roles.set_leader(leader->id());
  if (const auto* survivor = FindAgent(team, team.roles().survivor())) roles.set_survivor(survivor->id());
  roles.mutable_term();  // The initial term (0) has no issuer. Every other term is newer.
  roles.set_reason("team file");
  return roles;
}

Result<void> CheckRoles(const proto::TeamConfig& team, const proto::RoleAssignment& roles) {
  const auto check_rover = [&](AgentId id, const std::string& field) -> Result<void> {
    const proto::AgentConfig* agent = FindAgent(team, id);
    if (agent == nullptr) return Fail(ErrorCode::kRefused, "no agent has the id " + std::to_string(id), field);
    if (agent->kind() != proto::AGENT_KIND_ROVER) {
      return Fail(ErrorCode::kRefused, agent->name() + " is a base station; only a rover can hold this role", field);
    }
    return {};
  };
  if (roles.leader() == 0) return Fail(ErrorCode::kRefused, "the team needs a leader", "leader");
  if (const auto is_rover = check_rover(roles.leader(), "leader"); !is_rover) return is_rover;
  if (roles.survivor() == 0) return {};
  if (roles.survivor() == roles.leader()) {
    return Fail(ErrorCode::kRefused,
                FindAgent(team, roles.leader())->name() + " cannot be leader and designated survivor at once",
                "survivor");
  }
  return check_rover(roles.survivor(), "survivor");
}

proto::Role RoleOf(const proto::TeamConfig& team, const proto::RoleAssignment& roles, AgentId agent) {
  const proto::AgentConfig* config = FindAgent(team, agent);
  if (config == nullptr || config->left()) return proto::ROLE_UNSPECIFIED;
  if (config->kind() == proto::AGENT_KIND_BASE_STATION) return proto::ROLE_BASE_STATION;
  if (agent == roles.leader()) return proto::ROLE_LEADER;
  return agent == roles.survivor() ? proto::ROLE_DESIGNATED_SURVIVOR : proto::ROLE_ROVER;
}

AgentOfTeam AgentOf(const TeamFile& team, const std::string& agent_name) {
  return {team.config.team(), team.config.team_id(), agent_name};
}

Result<std::string> ClientEndpoint(const TeamFile& team, const std::string& agent_name) {
  return ClientEndpointIn(RunFolders().front(), AgentOf(team, agent_name));
}

}  // namespace moondb
