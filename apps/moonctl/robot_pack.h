// Packs the files of one agent into one file, and unpacks it on the robot.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "apps/moonctl/packed_files.h"
#include "model/error.h"
#include "proto/robot_pack.pb.h"
#include "runtime/team/team_config.h"

namespace moondb {

inline constexpr std::size_t kRobotPackBytesMax = 16 << 20;

// Returns a pack of the team file, every agent's public key, the secrets of `agent`, clients.yaml if it exists, and
// `options` (command-line options of moondb_agent) as the file AGENT.env for the unit of systemd. Requires: `agent` is
// in the team. Returns kInvalid if a file is missing, or if PackedNames, OptionsFile or CheckPackedContents refuses it.
Result<proto::RobotPack> PackRobot(const TeamFile& team, const std::filesystem::path& team_file,
                                   const std::string& agent, const std::string& options);

// Parses a pack and checks that no bit changed (XXH64), that it holds exactly the files of its agent, that its team
// file is valid, and the contents of its other files (CheckPackedContents). Returns kCorrupt for bytes that are no pack
// and for damaged packs, kInvalid for packs of another version and for other errors.
Result<proto::RobotPack> ParseRobotPack(const std::string& bytes);
std::string SerializeRobotPack(const proto::RobotPack& pack);

// Writes the files of a pack into `folder`, which is created if it is missing. Secrets get mode 0600, other files 0644,
// a new folder 0750. A pack sets no modes. A process of root gives the files to the owner of the folder, and a new
// folder to the user moondb, if there is one. Replaces a team file, public keys, clients.yaml and AGENT.env. Returns
// the names of the files that changed. Returns kRefused if the folder holds another secret of this agent, kInternal if
// a file cannot be written.
Result<std::vector<std::string>> UnpackRobot(const proto::RobotPack& pack, const std::filesystem::path& folder);

}  // namespace moondb
