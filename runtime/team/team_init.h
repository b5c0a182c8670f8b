// Writing team files, and giving one that was written by hand the id that it lacks. Plain functions; reading is
// runtime/team/team_config.h.
#pragma once

#include <filesystem>
#include <string>

#include "model/error.h"
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

}  // namespace moondb
