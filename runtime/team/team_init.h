// Writes team files and keys. Adds a missing team id or signing keys to a team file that was written by hand. Team
// files are read by runtime/team/team_config.h.
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

// As WriteInitialTeam in runtime/team/team_config.h, for a team called `name`. If `name` is empty, the team is named
// after the file's folder (PlainNameOf).
Result<void> WriteInitialTeam(const std::filesystem::path& path, int agent_count, int first_port,
                              const std::string& name);

// Converts `text` to a valid team name. Letters become lower case, each run of invalid characters becomes one -, and
// the result is cut to 32 characters. Returns "team" if nothing remains.
std::string PlainNameOf(const std::string& text);

// Returns `yaml` with a line `team_id: ...` after the team's name, otherwise unchanged. Returns kInvalid if no such
// line can be added because the name is missing or the text is not YAML. Requires: `yaml` has no team id.
Result<std::string> WithTeamId(const std::string& yaml, const std::string& team_id);

// Returns `yaml` with a line `signing_key: ...` for each agent in `keys`, otherwise unchanged. `keys` maps names of
// agents to public keys. Returns kInvalid if such a line cannot be added. Requires: none of these agents has a signing
// key in `yaml`.
Result<std::string> WithSigningKeys(const std::string& yaml, const std::map<std::string, std::string>& keys);

// A completed team file, and the agents whose signing keys were added.
struct SigningKeysAdded {
  std::string yaml;
  std::vector<std::string> agents;
};

// Returns `yaml` with signing keys for all agents that have none, and adds the files of their secrets to `files`.
// Returns kInvalid, with all errors, if the result would not be a valid team file, or if the team has no keys. Returns
// kRefused if a secret file already exists. `file` is the file name in errors; secret files are created beside it.
Result<SigningKeysAdded> AddSigningKeys(const std::string& yaml, const std::filesystem::path& file, NewFiles* files);

// Adds the key files of an agent to `files`: its public key at `public_path`, and its secrets NAME.sec and NAME.sign
// beside it. Errors as for NewFiles.
Result<void> AddAgentKeys(const std::filesystem::path& public_path, const SigningKey& signing, NewFiles* files);
// Adds only the secret of `signing`, as NAME.sign beside the public key.
Result<void> AddSigningSecret(const std::filesystem::path& public_path, const SigningKey& signing, NewFiles* files);

}  // namespace moondb
