#include "apps/moonctl/ros_process.h"

#include <signal.h>

#include <chrono>
#include <system_error>
#include <vector>

#include "apps/common/data_folder.h"
#include "apps/moonctl/agent_process.h"
#include "model/file_writing.h"
#include "model/text.h"

namespace moondb {
namespace {

constexpr std::chrono::seconds kJoinTimeout(10);
constexpr std::chrono::seconds kStopTimeout(10);

// The folder in which moondb_ros keeps its state and its log.
std::filesystem::path RosFolder(const std::filesystem::path& data_folder) { return data_folder / "ros"; }

std::filesystem::path LogIn(const std::filesystem::path& folder) { return folder / "moondb_ros.log"; }

// The file with the id of the process that StartRos started, so that StopRos ends no other.
std::filesystem::path StartedIn(const std::filesystem::path& folder) { return folder / "started_by_up"; }

}  // namespace

RosOutcome StartRos(const RosCommand& command, const std::filesystem::path& data_folder) {
  const std::filesystem::path folder = RosFolder(data_folder);
  if (const pid_t owner = OwnerOf(folder); owner != 0) return {owner, "was running", false};
  if (const auto made = MakeDataFolder(folder); !made) return {0, "failed: " + ToString(made.error()), true};
  const std::filesystem::path team_file = std::filesystem::absolute(command.team_file);
  const std::filesystem::path settings = team_file.parent_path() / "ros.yaml";
  std::vector<std::string> words{command.program.string(),
                                 "--team",
                                 team_file.string(),
                                 "--agent",
                                 command.agent,
                                 "--data-dir",
                                 std::filesystem::absolute(data_folder).string()};
  if (std::filesystem::exists(settings)) words.insert(words.end(), {"--config", settings.string()});
  if (!command.name_space.empty()) words.insert(words.end(), {"--namespace", command.name_space});
  const std::filesystem::path log = LogIn(folder);
  std::error_code ignored;  // There may be no log of an earlier run.
  std::filesystem::rename(log, log.string() + ".old", ignored);
  const Result<pid_t> started = StartProcess(words, log);
  if (!started) return {0, "failed: " + ToString(started.error()), true};
  if (const auto noted = WriteWholeFile(StartedIn(folder), std::to_string(*started), {0600, {}, false}); !noted) {
    ::kill(*started, SIGTERM);
    return {0, "failed: " + ToString(noted.error()), true};
  }
  bool has_ended = false;
  std::string said;
  const bool is_decided = WaitUntil(SteadyClock::now() + kJoinTimeout, [&] {
    has_ended = HasEnded(*started);
    said = LastLine(log);
    return has_ended || said.find(": publishes ") != std::string::npos;
  });
  if (has_ended) return {0, "failed: " + said, true};
  return {*started, is_decided ? "started" : said, false};
}

RosOutcome StopRos(const std::filesystem::path& data_folder) {
  const std::filesystem::path folder = RosFolder(data_folder);
  const pid_t owner = OwnerOf(folder);
  const bool is_ours = owner > 0 && ReadTextFile(StartedIn(folder)).value_or("") == std::to_string(owner);
  if (!is_ours || ::kill(owner, SIGTERM) != 0) return {};
  if (WaitUntil(SteadyClock::now() + kStopTimeout, [&] { return OwnerOf(folder) == 0; })) return {0, "stopped", false};
  return {owner, "does not stop", true};
}

}  // namespace moondb
