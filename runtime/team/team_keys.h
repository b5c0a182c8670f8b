// The keys that an agent needs, read from the files that the team file names.
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
  std::map<AgentId, std::string> public_keys;  // Of the whole team.
};

// `secret_key_file`: empty: beside the public key, with the ending .sec. `self` is in the team. kInvalid for a file
// that is missing, malformed or readable by others (secret), and for a secret that does not fit its public key.
Result<TeamKeys> ReadTeamKeys(const proto::TeamConfig& team, const std::filesystem::path& folder, AgentId self,
                              const std::filesystem::path& secret_key_file);

// Whether the file of the agent's secret key is where the team file has it, or the team has no keys.
bool HasSecretKey(const proto::TeamConfig& team, const std::filesystem::path& folder, const proto::AgentConfig& agent);

// The key that `self` signs with; in a team without signing keys there is none. From NAME.sign beside the secret CURVE
// key, as above. kInvalid too where it does not fit the team file.
Result<std::optional<SigningKey>> ReadSigningKey(const proto::TeamConfig& team, const std::filesystem::path& folder,
                                                 AgentId self, const std::filesystem::path& secret_key_file);

}  // namespace moondb
