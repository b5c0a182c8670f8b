// Files that belong together, written for others: a map's picture and its text, a graph and where it came from.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "model/error.h"

namespace moondb {

struct FileBytes {
  std::filesystem::path file;
  std::string bytes;
};

// Each is written beside and renamed, in this order; SIGINT, SIGTERM and SIGHUP wait until all of them are there, so
// that none stands beside the other of an earlier time. kInternal, with the path and what to do, if one cannot be
// written.
Result<void> WriteTogether(const std::vector<FileBytes>& files);

// The folder and those above it. kInternal, with the path and what to do.
Result<void> MakeFolder(const std::filesystem::path& folder);

}  // namespace moondb
