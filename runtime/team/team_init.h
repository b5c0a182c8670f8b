// Writes team files and keys. Adds a missing team id or missing signing keys to a team file that was written by hand.
// To read team files, see runtime/team/team_config.h.
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

// Writes the files of WriteInitialTeam (runtime/team/team_config.h) for a team called `name`. If `name` is empty,
// the team is called DefaultTeamName.
Result<void> WriteInitialTeam(const std::filesystem::path& path, int agent_count, int first_port,
                              const std::string& name);

// Converts `text` to a valid team name. Letters become lower case, each run of invalid characters becomes one -, and
// the result is cut to 32 characters. Returns "team" if nothing remains.
std::string PlainNameOf(const std::string& text);

// Returns the name that a team has by default: one made of the name of the file's folder (PlainNameOf).
std::string DefaultTeamName(const std::filesystem::path& file);

// Returns `yaml` with a new line `team_id: ...` below the team's name. Returns kInvalid if the line cannot be added
// because the name is missing or the text is not YAML. Requires: `yaml` has no team id.
Result<std::string> WithTeamId(const std::string& yaml, const std::string& team_id);

// Returns `yaml` with a new field `signing_key: ...` for each agent in `keys`, which maps names of agents to public
// keys. Returns kInvalid if a field cannot be added. Requires: none of these agents has a signing key in `yaml`.
Result<std::string> WithSigningKeys(const std::string& yaml, const std::map<std::string, std::string>& keys);

// A completed team file and the names of the agents whose signing keys were added.
struct SigningKeysAdded {
  std::string yaml;
  std::vector<std::string> agents;
};

// Returns `yaml` with signing keys for all agents that have none, and adds the files of the secrets to `files`. Returns
// kInvalid, with all errors, if the result would not be a valid team file or if the team is `insecure`. Returns
// kRefused if a secret file already exists. `file` is the file name in errors; the secret files lie beside the public
// keys.
Result<SigningKeysAdded> AddSigningKeys(const std::string& yaml, const std::filesystem::path& file, NewFiles* files);

// Returns `yaml` with `agent` below its last agent, and adds the agent's new key files to `files`. Sets the agent's id
// if it is 0 (one more than the highest), and its key and signing key unless the team is `insecure`. Returns kInvalid,
// with all errors, if the result would not be a valid team file, or if the place for the agent is not found. Returns
// kRefused if a key file already exists. `file` is the path of the team file; the key files lie beside it.
Result<std::string> AddAgent(const std::string& yaml, const std::filesystem::path& file, proto::AgentConfig& agent,
                             NewFiles* files);

// Adds the key files of an agent to `files`: a new public CURVE key at `public_path`, and the secrets NAME.sec and
// NAME.sign beside it. Returns the errors of NewFiles::Add and MakeCurveKeys.
Result<void> AddAgentKeys(const std::filesystem::path& public_path, const SigningKey& signing, NewFiles* files);
// Adds only the secret of `signing` to `files`, as NAME.sign beside the public key.
Result<void> AddSigningSecret(const std::filesystem::path& public_path, const SigningKey& signing, NewFiles* files);

}  // namespace moondb
