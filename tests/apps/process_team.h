// ProcessTeam: base of tests with real processes. Makes a temporary folder with the team file of three rovers and a
// base station. The team uses CURVE and ipc sockets in that folder, so it needs no ports. TearDown kills all agents
// that still run.
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

// Adapts a team file that `moonctl config init` has made. Replaces loopback addresses by ipc sockets in `folder`. Turns
// off automatic solving, whose records could disturb tests that compare the records of agents.
void AdaptToTest(const std::filesystem::path& team_file, const std::filesystem::path& folder);

class ProcessTeam : public testing::Test {
 protected:
  void SetUp() override;
  void TearDown() override;

  Outcome Moonctl(std::vector<std::string> arguments);
  // Runs `moonctl`, expects `exit_code`, and returns stdout.
  std::string MoonctlExpecting(int exit_code, std::vector<std::string> arguments);
  // Runs `moonctl` with --json, expects `exit_code`, and returns the parsed output.
  google::protobuf::Struct MoonctlJson(int exit_code, std::vector<std::string> arguments);

  // Starts a moondb_agent directly, without `moonctl up`.
  std::unique_ptr<Child> StartAgent(const std::string& name, std::vector<std::string> more = {});
  Outcome Run(std::vector<std::string> command);

  std::unique_ptr<Client> Connect(const std::string& name);
  // Returns the agent's process id, read from the lock of its data folder. 0: the agent is not running.
  pid_t PidOf(const std::string& name);
  void Kill(const std::string& name);  // Sends SIGKILL and waits until the agent has ended.

  // Polls until `condition` holds, for at most `limit`. Returns false if it never held.
  static bool Until(const std::function<bool()>& condition, std::chrono::seconds limit = std::chrono::seconds(30));

  std::set<RecordKey> KeysHeldBy(const std::string& name);

  const TemporaryFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path();
  std::filesystem::path team_file_ = folder_ / "team.yaml";
  std::map<std::string, std::string> environment_;
};

}  // namespace moondb
