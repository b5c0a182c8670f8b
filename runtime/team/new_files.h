// NewFiles: creates several files together and never overwrites an existing file.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "model/error.h"
#include "model/file_writing.h"

namespace moondb {

// Writes `content` to the new file `path` with exactly this mode, whatever the umask, and syncs it to disk. With an
// owner, gives the file to that user. Follows no link. Returns kRefused if `path` exists, kInternal if a system call
// fails.
Result<void> WriteNewFile(const std::filesystem::path& path, const std::string& content, mode_t mode,
                          const std::optional<FileOwner>& owner = {});

class NewFiles {
 public:
  NewFiles() = default;
  NewFiles(const NewFiles&) = delete;
  NewFiles& operator=(const NewFiles&) = delete;
  ~NewFiles();  // Removes the temporary files.

  // Writes `content` to a temporary file in the folder of `path` and syncs it to disk. Creates a missing folder with
  // access for its owner only. Returns kRefused if `path` exists, kInternal if a system call fails.
  Result<void> Add(const std::filesystem::path& path, const std::string& content, mode_t mode);

  // Moves each file to its path, in the order of the Add calls. On the first failure, removes the files that this call
  // has moved. Returns kRefused if a file has appeared at a path since Add, kInternal if a system call fails.
  Result<void> Publish();

  // Removes the files that Publish created. For callers whose later steps fail.
  void TakeBack();

 private:
  struct File {
    std::filesystem::path aside;
    std::filesystem::path path;
  };
  std::vector<File> files_;
};

}  // namespace moondb
