// Reads the keys of an agent from the files that the team file names.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "model/error.h"
#include "model/ids.h"
#include "proto/team.pb.h"
#include "runtime/team/curve_keys.h"
#include "runtime/team/signing_key.h"

namespace moondb {

struct TeamKeys {
  CurveKeys own;
  std::map<AgentId, std::string> public_keys;  // Public keys of all agents of the team.
};

// Reads the CURVE keys of `self` and the public keys of the team. If `secret_key_file` is empty, reads the secret key
// beside the public key, with the extension .sec. Requires: `self` is in the team. Returns kInvalid if a file is
// missing or malformed, if others may read the secret, or if the secret does not match its public key.
Result<TeamKeys> ReadTeamKeys(const proto::TeamConfig& team, const std::filesystem::path& folder, AgentId self,
                              const std::filesystem::path& secret_key_file);

// Returns true if the secret key of `agent` exists at its default path, or if the team has no keys.
bool HasSecretKey(const proto::TeamConfig& team, const std::filesystem::path& folder, const proto::AgentConfig& agent);

// Returns the signing key of `self`, or nothing if the team has no signing keys. Reads NAME.sign beside the secret
// CURVE key, which is found as in ReadTeamKeys. Returns kInvalid if the file fails the checks of ReadSecretKey, or if
// its key does not match the signing key of `self` in the team file.
Result<std::optional<SigningKey>> ReadSigningKey(const proto::TeamConfig& team, const std::filesystem::path& folder,
                                                 AgentId self, const std::filesystem::path& secret_key_file);

}  // namespace moondb
