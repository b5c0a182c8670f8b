// Writing team files and keys, and giving a file that was written by hand the id and the signing keys that it lacks.
// Plain functions; reading is runtime/team/team_config.h.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "model/error.h"
#include "runtime/team/new_files.h"
#include "runtime/team/signing_key.h"
#include "runtime/team/team_config.h"

namespace moondb {

// As WriteInitialTeam of runtime/team/team_config.h, for a team called `name`; empty: as the file's folder is, as far
// as that can be a name (PlainNameOf).
Result<void> WriteInitialTeam(const std::filesystem::path& path, int agent_count, int first_port,
                              const std::string& name);

// `text` as a name of a team: small letters, runs of what a name cannot hold as one -, cut to 32 characters; "team"
// where nothing is left.
std::string PlainNameOf(const std::string& text);

// The file's text with a line `team_id: ...` behind its team's name, all else byte for byte. kInvalid where no such
// line can be added: no name, or no YAML. `yaml` has no team id.
Result<std::string> WithTeamId(const std::string& yaml, const std::string& team_id);

// The file's text with a line `signing_key: ...` for each of these agents, by name, all else byte for byte. kInvalid
// where such a line cannot be added. None of them has one in `yaml`.
Result<std::string> WithSigningKeys(const std::string& yaml, const std::map<std::string, std::string>& keys);

// A team file that was completed, and the agents that have a signing key since.
struct SigningKeysAdded {
  std::string yaml;
  std::vector<std::string> agents;
};

// The file's text with signing keys for all agents that have none, whose secrets wait in `files`. What it comes to is a
// team file without an error; kInvalid, with all that is wrong, where it would not be, and for a team without keys.
// kRefused where a secret is there already. `file` stands in errors, and secrets go beside it.
Result<SigningKeysAdded> AddSigningKeys(const std::string& yaml, const std::filesystem::path& file, NewFiles* files);

// What an agent needs, to be published with `files`: its public key at `public_path`, its secrets NAME.sec and
// NAME.sign beside it. Errors as of NewFiles.
Result<void> AddAgentKeys(const std::filesystem::path& public_path, const SigningKey& signing, NewFiles* files);
// The secret of `signing` alone, as NAME.sign beside the public key.
Result<void> AddSigningSecret(const std::filesystem::path& public_path, const SigningKey& signing, NewFiles* files);

}  // namespace moondb
