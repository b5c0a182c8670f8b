// An agent's data folder on this machine, and the lock that lets only one process use the folder.
//
// The lock consists of a file lock (F_OFD_SETLK) on `agent.pid`, which holds the owner's process id, and a flock of the
// folder. The kernel releases both locks when the process ends. If the disk is full, faulty or read-only, so that
// `agent.pid` cannot be written, the flock alone protects the folder.
//
// `agent.identity` names the team and the agent that own the data, by their permanent ids. `agent.endpoint` holds the
// client endpoint of the process that holds the lock. If the lock is free, `agent.endpoint` is outdated.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <optional>
#include <string>

#include "model/error.h"
#include "model/ids.h"
#include "proto/team.pb.h"

namespace moondb {

inline constexpr char kDatabaseFile[] = "moondb.sqlite";  // Name of the file in an agent's data folder.

// Returns `moondb-data` in the team file's folder: the folder that holds the data folders of this machine's agents.
std::filesystem::path DefaultDataRoot(const std::filesystem::path& team_folder);

// The agent whose data a folder holds.
struct DataOwner {
  std::string team_id;  // Value of `team_id` in the team file.
  AgentId agent = 0;
  bool operator==(const DataOwner&) const = default;
};
DataOwner DataOwnerOf(const proto::TeamConfig& team, const proto::AgentConfig& agent);

// Returns the owner that the folder's `agent.identity` names. Returns nothing if that file is missing or unreadable.
std::optional<DataOwner> ReadDataOwner(const std::filesystem::path& folder);

// Returns the path of the agent's data folder in `root`, which need not exist: the folder whose `agent.identity` names
// this agent, whatever the folder's name. If no folder names this agent, returns `root`/NAME, or `root`/NAME-ID if
// another agent of the team owns `root`/NAME. Ignores folders whose names cannot be agents' names, such as
// "rover1.old". Returns kRefused if several folders name this agent and none of them is `root`/NAME, or if `root`/NAME
// holds another team's data.
Result<std::filesystem::path> FindDataFolder(const std::filesystem::path& root, const proto::TeamConfig& team,
                                             const proto::AgentConfig& agent);

// Writes the owner into the folder if the folder names no owner yet. kRefused if the folder names another owner,
// kInternal if the file cannot be written.
Result<void> MarkDataFolder(const std::filesystem::path& folder, const DataOwner& owner);

// Makes the folder and its missing parents with mode 0700. An existing folder is left as it is. Returns kInternal if a
// folder cannot be made.
Result<void> MakeDataFolder(const std::filesystem::path& folder);

// Writes the endpoint to `agent.endpoint` (client/endpoint.h) unless the file already holds it. Returns kInternal if
// writing fails.
Result<void> WriteEndpoint(const std::filesystem::path& folder, const std::string& endpoint);

// Returns the id of the process that holds the lock of `folder`. 0: no process holds the lock, or its id is unknown.
pid_t OwnerOf(const std::filesystem::path& folder);

class DataFolderLock {
 public:
  // Creates `folder` (mode 0700) if it is missing, locks it, and writes this process's id to `agent.pid` if the disk
  // accepts the write. Returns kRefused if another process holds the lock, and kInternal if the folder cannot be
  // created or locked.
  static Result<DataFolderLock> Take(const std::filesystem::path& folder);

  DataFolderLock(DataFolderLock&& other) noexcept;
  DataFolderLock& operator=(DataFolderLock&& other) = delete;
  ~DataFolderLock();  // Releases the locks.

 private:
  explicit DataFolderLock(int folder) : folder_(folder) {}
  int folder_ = -1;
  int descriptor_ = -1;  // Descriptor of the locked agent.pid. -1: the file is not locked.
};

}  // namespace moondb
