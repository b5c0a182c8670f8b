// NewFiles: several files that appear together and replace nothing.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

#include "model/error.h"

namespace moondb {

class NewFiles {
 public:
  NewFiles() = default;
  NewFiles(const NewFiles&) = delete;
  NewFiles& operator=(const NewFiles&) = delete;
  ~NewFiles();  // Removes what Publish did not bring to its place.

  // Written aside, in the same folder, and to the disk. Makes the folder, for its owner alone, if there is none.
  // kRefused if `path` exists, kInternal if the system fails.
  Result<void> Add(const std::filesystem::path& path, const std::string& content, mode_t mode);

  // Brings each to its place, in the order of Add; on the first failure takes back those of this call.
  // kRefused if something has appeared there since Add.
  Result<void> Publish();

  // Removes what Publish brought to its place, where that came to nothing after all.
  void TakeBack();

 private:
  struct File {
    std::filesystem::path aside;
    std::filesystem::path path;
  };
  std::vector<File> files_;
};

}  // namespace moondb
