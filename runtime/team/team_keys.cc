#include "runtime/team/team_keys.h"

#include "model/check.h"
#include "model/team_member.h"
#include "runtime/team/role_signature.h"

namespace moondb {
namespace {

std::filesystem::path SecretPathOf(const proto::AgentConfig& agent, const std::filesystem::path& folder,
                                   const std::filesystem::path& given) {
  return given.empty() ? SecretKeyPath(folder / agent.key()) : given;
}

}  // namespace

Result<TeamKeys> ReadTeamKeys(const proto::TeamConfig& team, const std::filesystem::path& folder, AgentId self,
                              const std::filesystem::path& secret_key_file) {
  TeamKeys keys;
  for (const proto::AgentConfig& agent : team.agents()) {
    const Result<std::string> key = ReadPublicKey(folder / agent.key());
    if (!key) return tl::unexpected(key.error());
    keys.public_keys[agent.id()] = *key;
  }
  const proto::AgentConfig* agent = FindAgent(team, self);
  Check(agent != nullptr, "the agent itself is in the team");
  const std::filesystem::path public_path = folder / agent->key();
  const std::filesystem::path secret_path = SecretPathOf(*agent, folder, secret_key_file);
  const Result<std::string> secret = ReadSecretKey(secret_path);
  if (!secret) return tl::unexpected(secret.error());
  keys.own = {keys.public_keys[self], *secret};
  if (const Result<std::string> fitting = PublicKeyOf(*secret); !fitting || *fitting != keys.own.public_key) {
    return Fail(ErrorCode::kInvalid, secret_path.string() + ": does not fit the public key " + public_path.string());
  }
  return keys;
}

bool HasSecretKey(const proto::TeamConfig& team, const std::filesystem::path& folder, const proto::AgentConfig& agent) {
  std::error_code error;
  return team.insecure() || std::filesystem::exists(SecretPathOf(agent, folder, {}), error);
}

Result<std::optional<SigningKey>> ReadSigningKey(const proto::TeamConfig& team, const std::filesystem::path& folder,
                                                 AgentId self, const std::filesystem::path& secret_key_file) {
  if (!HasSigningKeys(team)) return std::optional<SigningKey>();
  const proto::AgentConfig* agent = FindAgent(team, self);
  Check(agent != nullptr, "the agent itself is in the team");
  const std::filesystem::path path = SigningSecretPath(SecretPathOf(*agent, folder, secret_key_file));
  Result<SigningKey> key = SigningKey::Read(path);
  if (!key) return tl::unexpected(key.error());
  if (key->public_key() != agent->signing_key()) {
    return Fail(ErrorCode::kInvalid,
                path.string() + ": does not fit the signing_key of " + agent->name() + " in the team file");
  }
  return std::optional<SigningKey>(*std::move(key));
}

}  // namespace moondb
