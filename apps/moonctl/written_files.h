// Writes several files together, such as a map's picture and its description, and replaces single files atomically.
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

// Creates `folder` if it is missing, unless its path is empty. Writes every file under a temporary name, then renames
// the files in the given order. Replaces links, and follows none. If a file cannot be written, for example because the
// disk is full, the old files remain. Delays SIGINT, SIGTERM and SIGHUP until all files are renamed, so that new and
// old files are not mixed. Returns kInternal, with the path and a remedy, if the folder or a file cannot be written.
Result<void> WriteTogether(const std::filesystem::path& folder, const std::vector<FileBytes>& files);

// Replaces an existing file atomically and durably: after a crash the file has either its old or its new content. Keeps
// the file's mode, without the right of all users to write; a process of root keeps its owner. If `file` is a symbolic
// link of this user or of root, replaces the link's target. Returns kRefused for a link that another user made, and
// kInternal, with the path, if the file cannot be replaced.
Result<void> ReplaceFile(const std::filesystem::path& file, const std::string& bytes);

}  // namespace moondb
