// Rules for the files in a pack: which names and which contents a robot accepts.
//
// `moonctl config unpack` writes these files as root, and an agent reads them. A pack that somebody forged must
// therefore not bring anything but a team file, keys, a client list and options.
#pragma once

#include <string>
#include <vector>

#include "model/error.h"
#include "proto/robot_pack.pb.h"
#include "proto/team.pb.h"

namespace moondb {

// A team file has this name in a pack.
inline constexpr char kPackedTeamFile[] = "team.yaml";

// A file that a pack holds.
struct PackedName {
  std::string name;
  bool is_secret = false;
  bool is_optional = false;
};

// Returns the files of a pack for `agent`, with their names beside the team file. Returns kInvalid if the team file
// names a key file that does not lie beside it, or whose name does not end in ".pub" or has other characters than
// letters, digits, '-', '_' and '.'. Requires: `agent` is in the team.
Result<std::vector<PackedName>> PackedNames(const proto::TeamConfig& team, const std::string& agent);

// Returns the contents of AGENT.env: the line AGENT_OPTIONS=OPTIONS, for systemd. Returns kInvalid if `options` have a
// character other than letters, digits, spaces and -_.,:/=@+[] .
Result<std::string> OptionsFile(const std::string& options);

// Checks the contents of all files but the team file: each key file holds one key, the secret keys match the public
// keys, clients.yaml is a client list, and AGENT.env comes from OptionsFile. Returns kInvalid, with the file's name.
// Requires: the pack holds the files of PackedNames.
Result<void> CheckPackedContents(const proto::RobotPack& pack, const proto::TeamConfig& team);

// Returns the content of a packed file. Empty: the pack holds no such file.
std::string ContentOf(const proto::RobotPack& pack, const std::string& name);

}  // namespace moondb
