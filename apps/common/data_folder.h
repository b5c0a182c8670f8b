// An agent's data folder on this machine, and the lock that lets only one process use it.
//
// The lock is an open file description lock (F_OFD_SETLK) on `agent.pid` in the folder, which holds the owner's process
// id. The kernel releases the lock when the process dies, so a leftover file means nothing. The folder itself is locked
// too (flock). If `agent.pid` cannot be written, because the disk is full, faulty or read-only, only the flock protects
// the folder, and the kernel's list of locks names the owner.
//
// An agent's folder is found by the agent's id, which is permanent, and not by its name. `agent.identity` in the folder
// names the owner of the data. `agent.endpoint` holds the client endpoint of the process that holds the lock,
// independent of the environment in which that process was started. If the lock is free, `agent.endpoint` is stale.
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
  std::string team_id;  // In the form in which team files write it.
  AgentId agent = 0;
  bool operator==(const DataOwner&) const = default;
};
DataOwner DataOwnerOf(const proto::TeamConfig& team, const proto::AgentConfig& agent);

// Returns the owner that the folder's `agent.identity` names. Returns nothing if that file is missing or unreadable.
std::optional<DataOwner> ReadDataOwner(const std::filesystem::path& folder);

// Returns the path of the agent's data folder in `root`. `root` need not exist. Chooses the folder that names this
// agent as its owner, whatever the folder's name. Ignores folders without a plain name, such as "rover1.old". Without
// such a folder, returns `root`/NAME. Returns `root`/NAME-ID if another agent of the team owns `root`/NAME. kRefused if
// several folders name this agent and none has its name, or if `root`/NAME holds another team's data.
Result<std::filesystem::path> FindDataFolder(const std::filesystem::path& root, const proto::TeamConfig& team,
                                             const proto::AgentConfig& agent);

// Writes the owner into the folder if the folder names no owner yet. kRefused if the folder names another owner,
// kInternal if the file cannot be written.
Result<void> MarkDataFolder(const std::filesystem::path& folder, const DataOwner& owner);

// Returns the client endpoint that `agent.endpoint` in `folder` holds. Empty: the file is missing or holds none.
std::string ReadEndpoint(const std::filesystem::path& folder);
// Writes the endpoint to `agent.endpoint` unless the file already holds it. kInternal if it cannot be written.
Result<void> WriteEndpoint(const std::filesystem::path& folder, const std::string& endpoint);

// Returns the id of the process that holds the locks of `folder` now. 0: no process.
pid_t OwnerOf(const std::filesystem::path& folder);

class DataFolderLock {
 public:
  // Creates the folder (0700) if it is missing, takes the locks, and writes this process' id if the disk accepts it.
  // Returns kRefused if another process holds the locks, and kInternal if the folder cannot be made or locked.
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
