// Where an agent keeps its data on this machine, and the lock that lets only one process have them.
//
// The lock is one of an open file (F_OFD_SETLK) on `agent.pid` in the folder, which holds the owner's process id: the
// kernel frees it when the process dies, however it dies, so a file that is left behind means nothing.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>

#include "model/error.h"

namespace moondb {

inline constexpr char kDatabaseFile[] = "moondb.sqlite";  // In an agent's data folder.

// `moondb-data/<agent>` beside the team file.
std::filesystem::path DefaultDataFolder(const std::filesystem::path& team_file, const std::string& agent_name);

// The process that holds `folder` now; 0: nobody.
pid_t OwnerOf(const std::filesystem::path& folder);

class DataFolderLock {
 public:
  // Makes the folder (0700) where it is missing, takes the lock, writes this process' id. kRefused if another process
  // has it, kInternal if the folder cannot be made or written.
  static Result<DataFolderLock> Take(const std::filesystem::path& folder);

  DataFolderLock(DataFolderLock&& other) noexcept;
  DataFolderLock& operator=(DataFolderLock&& other) = delete;
  ~DataFolderLock();  // Frees it.

 private:
  explicit DataFolderLock(int descriptor) : descriptor_(descriptor) {}
  int descriptor_ = -1;
};

}  // namespace moondb
