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

// Makes `folder` (empty: none) where it is missing, then writes all files beside and renames them, in this order: what
// cannot be written, on a full disk say, leaves the files of an earlier time. SIGINT, SIGTERM and SIGHUP wait until all
// of them are there, so that none stands beside the other of an earlier time. kInternal, with the path and what to do,
// if the folder cannot be made or a file not be written.
Result<void> WriteTogether(const std::filesystem::path& folder, const std::vector<FileBytes>& files);

// Puts `bytes` in the place of a file that is there, at once and on the disk: a crash leaves the one or the other. It
// keeps who may read it; a link stays one, and the file that it leads to is replaced. kInternal with the path.
Result<void> ReplaceFile(const std::filesystem::path& file, const std::string& bytes);

}  // namespace moondb
