#include "tests/apps/process_team.h"

#include <google/protobuf/util/json_util.h>
#include <signal.h>

#include <fstream>
#include <thread>

#include "apps/common/data_folder.h"
#include "apps/common/team_clients.h"
#include "model/team_member.h"
#include "model/text.h"

namespace moondb {

void AdaptToTest(const std::filesystem::path& team_file, const std::filesystem::path& folder) {
  std::string text = *ReadTextFile(team_file);
  const std::string address = "tcp://127.0.0.1:";
  for (std::size_t at = text.find(address); at != std::string::npos; at = text.find(address)) {
    const std::size_t end = text.find('"', at);
    const std::string port = text.substr(at + address.size(), end - at - address.size());
    text.replace(at, end - at, "ipc://" + (folder / ("p" + port)).string());
  }
  // The rovers start side by side.
  const std::string no_start = "# start: {x: 0, y: 0,";
  for (int i = 0; text.find(no_start) != std::string::npos; ++i) {
    text.replace(text.find(no_start), no_start.size(), "start: {x: 0, y: " + std::to_string(2 * i) + ",");
  }
  const std::string unasked = "solve_by_itself: true";
  ASSERT_NE(text.find(unasked), std::string::npos);
  text.replace(text.find(unasked), unasked.size(), "solve_by_itself: false");
  ASSERT_TRUE(WriteTextFile(team_file, text).has_value());
}

void ProcessTeam::SetUp() {
  environment_ = {
      {"MOONDB_RUN_DIR", folder_ / "run"}, {"MOONDB_TEAM", team_file_}, {"XDG_CONFIG_HOME", folder_ / "config"}};
  const Outcome made = Run({MOONCTL_PROGRAM, "config", "init", "--name", "moon", "--agents", "4", team_file_});
  ASSERT_EQ(made.exit_code, 0) << made.error;
  AdaptToTest(team_file_, folder_);
}

void ProcessTeam::TearDown() {
  for (const char* name : {"rover1", "rover2", "rover3", "base"}) {
    if (HasFailure()) {
      const auto log = ReadTextFile(DefaultDataRoot(folder_) / name / "agent.log");
      if (log) std::cerr << "--- log of " << name << "\n" << *log;
    }
    if (PidOf(name) > 0) Kill(name);
  }
}

Outcome ProcessTeam::Run(std::vector<std::string> command) {
  return Child(std::move(command), environment_, folder_).Wait();
}

Outcome ProcessTeam::Moonctl(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), MOONCTL_PROGRAM);
  return Run(std::move(arguments));
}

std::string ProcessTeam::MoonctlExpecting(int exit_code, std::vector<std::string> arguments) {
  std::string words;
  for (const std::string& argument : arguments) words += " " + argument;
  const Outcome outcome = Moonctl(std::move(arguments));
  EXPECT_EQ(outcome.exit_code, exit_code) << "moonctl" << words << "\n" << outcome.out << outcome.error;
  return outcome.out;
}

google::protobuf::Struct ProcessTeam::MoonctlJson(int exit_code, std::vector<std::string> arguments) {
  arguments.push_back("--json");
  const std::string text = MoonctlExpecting(exit_code, std::move(arguments));
  google::protobuf::Struct json;
  EXPECT_TRUE(google::protobuf::util::JsonStringToMessage(text, &json).ok()) << text;
  return json;
}

std::unique_ptr<Child> ProcessTeam::StartAgent(const std::string& name, std::vector<std::string> more) {
  std::vector<std::string> command{MOONDB_AGENT_PROGRAM, "--team", team_file_, "--agent", name};
  command.insert(command.end(), more.begin(), more.end());
  return std::make_unique<Child>(std::move(command), environment_, folder_);
}

std::unique_ptr<Client> ProcessTeam::Connect(const std::string& name) {
  const auto team = ReadTeamFile(team_file_);
  EXPECT_TRUE(team.has_value());
  ::setenv("MOONDB_RUN_DIR", environment_.at("MOONDB_RUN_DIR").c_str(), 1);
  auto client = ConnectTo(*team, *FindAgent(team->config, name), {.timeout = std::chrono::seconds(30)});
  EXPECT_TRUE(client.has_value()) << ToString(client.error());
  return client ? std::move(*client) : nullptr;
}

pid_t ProcessTeam::PidOf(const std::string& name) { return OwnerOf(DefaultDataRoot(folder_) / name); }

void ProcessTeam::Kill(const std::string& name) {
  const pid_t pid = PidOf(name);
  ASSERT_GT(pid, 0) << name << " does not run";
  ::kill(pid, SIGKILL);
  EXPECT_TRUE(Until([&] { return PidOf(name) == 0; }));
}

bool ProcessTeam::Until(const std::function<bool()>& condition, std::chrono::seconds limit) {
  const auto deadline = std::chrono::steady_clock::now() + limit;
  while (!condition()) {
    if (std::chrono::steady_clock::now() >= deadline) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return true;
}

std::set<RecordKey> ProcessTeam::KeysHeldBy(const std::string& name) {
  std::set<RecordKey> keys;
  const auto client = Connect(name);
  if (client == nullptr) return keys;
  const auto read = client->ReadAll({}, [&keys](const proto::StoredRecord& stored, const proto::Record&) {
    keys.insert(FromProto(stored.key()));
    return Result<void>();
  });
  EXPECT_TRUE(read.has_value()) << ToString(read.error());
  return keys;
}

}  // namespace moondb
