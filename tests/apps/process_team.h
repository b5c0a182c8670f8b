// ProcessTeam: a folder with a team file for real processes: three rovers and a base station, with CURVE, on ipc
// sockets of that folder: no port is taken. Everything that still runs at the end is killed.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "client/client.h"
#include "google/protobuf/struct.pb.h"
#include "runtime/team/team_config.h"
#include "tests/apps/program.h"
#include "tests/temporary_folder.h"

namespace moondb {

// Loopback addresses, as `config init` writes them, become ipc sockets in `folder`.
void AdaptToTest(const std::filesystem::path& team_file, const std::filesystem::path& folder);

class ProcessTeam : public testing::Test {
 protected:
  void SetUp() override;
  void TearDown() override;

  // Runs `moonctl` with the team file; `MOONDB_RUN_DIR` lies in the folder.
  Outcome Moonctl(std::vector<std::string> arguments);
  // The same, must end with `exit_code`; gives stdout.
  std::string MoonctlExpecting(int exit_code, std::vector<std::string> arguments);
  // The same with --json: parsed.
  google::protobuf::Struct MoonctlJson(int exit_code, std::vector<std::string> arguments);

  // A moondb_agent started by hand.
  std::unique_ptr<Child> StartAgent(const std::string& name, std::vector<std::string> more = {});
  Outcome Run(std::vector<std::string> command);

  std::unique_ptr<Client> Connect(const std::string& name);
  // Of a running agent, by its lock file.
  pid_t PidOf(const std::string& name);
  void Kill(const std::string& name);  // kill -9, and waits until it is gone.

  // Polls until it holds, at most `limit`.
  static bool Until(const std::function<bool()>& condition, std::chrono::seconds limit = std::chrono::seconds(30));

  std::set<RecordKey> KeysHeldBy(const std::string& name);

  const TemporaryFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path();
  std::filesystem::path team_file_ = folder_ / "team.yaml";
  std::map<std::string, std::string> environment_;
};

}  // namespace moondb
