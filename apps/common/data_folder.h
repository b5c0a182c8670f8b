// Where an agent keeps its data on this machine, and the lock that lets only one process have them.
//
// The lock is one of an open file (F_OFD_SETLK) on `agent.pid` in the folder, which holds the owner's process id: the
// kernel frees it when the process dies, however it dies, so a file that is left behind means nothing. Beside it stands
// a lock of the folder itself (flock): where the file cannot be written, on a disk that is full, fails or is read-only,
// that one is all there is, and the kernel's list of locks says whose it is.
//
// An agent is found by its id, which is for ever, and not by its name: `agent.identity` in the folder says whose the
// data are, and `agent.endpoint` where the clients of the process that holds the lock are let in, whatever the
// environment was in which it was started. Of a folder whose lock is free the latter means nothing.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <optional>
#include <string>

#include "model/error.h"
#include "model/ids.h"
#include "proto/team.pb.h"

namespace moondb {

inline constexpr char kDatabaseFile[] = "moondb.sqlite";  // In an agent's data folder.

// `moondb-data` in the team file's folder, which holds the folders of the agents of this machine.
std::filesystem::path DefaultDataRoot(const std::filesystem::path& team_folder);

// Whose data a folder holds.
struct DataOwner {
  std::string team_id;  // As team files have it.
  AgentId agent = 0;
  bool operator==(const DataOwner&) const = default;
};
DataOwner DataOwnerOf(const proto::TeamConfig& team, const proto::AgentConfig& agent);

// As the folder says; nothing where it says nothing that can be read.
std::optional<DataOwner> ReadDataOwner(const std::filesystem::path& folder);

// The agent's folder in `root`, whether it is there or not: the one that says that it holds the data of this agent,
// whatever its name (a plain one: a "rover1.old" is set aside); else `root`/NAME, or NAME-ID where another agent of the
// team has that. kRefused where several say so, and none has the agent's name; where the folder holds another team's
// data.
Result<std::filesystem::path> FindDataFolder(const std::filesystem::path& root, const proto::TeamConfig& team,
                                             const proto::AgentConfig& agent);

// Lets the folder say whose data it holds, unless it does. kRefused if it says that they are another's, kInternal if it
// cannot be written.
Result<void> MarkDataFolder(const std::filesystem::path& folder, const DataOwner& owner);

// Where the clients of the process that holds `folder` are let in, as it wrote; empty: it wrote nothing.
std::string ReadEndpoint(const std::filesystem::path& folder);
// Writes only what is not there. kInternal if it cannot be written.
Result<void> WriteEndpoint(const std::filesystem::path& folder, const std::string& endpoint);

// The process that holds `folder` now; 0: nobody.
pid_t OwnerOf(const std::filesystem::path& folder);

class DataFolderLock {
 public:
  // Makes the folder (0700) where it is missing, takes the locks, writes this process' id where the disk takes it.
  // kRefused if another process has them, kInternal if the folder cannot be made, or locked.
  static Result<DataFolderLock> Take(const std::filesystem::path& folder);

  DataFolderLock(DataFolderLock&& other) noexcept;
  DataFolderLock& operator=(DataFolderLock&& other) = delete;
  ~DataFolderLock();  // Frees it.

 private:
  explicit DataFolderLock(int folder) : folder_(folder) {}
  int folder_ = -1;
  int descriptor_ = -1;  // Of agent.pid; -1: it holds no lock.
};

}  // namespace moondb
