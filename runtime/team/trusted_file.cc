#include "runtime/team/trusted_file.h"

#include <sys/stat.h>
#include <unistd.h>

#include <string>
#include <system_error>

#include "model/file_writing.h"

namespace moondb {
namespace {

// Checks one file or folder, not the folder that holds it.
Result<void> CheckEntry(const std::filesystem::path& path, const struct stat& status) {
  if (status.st_uid != ::geteuid() && status.st_uid != 0 && ::geteuid() != 0) {
    return Fail(ErrorCode::kInvalid, path.string() + ": belongs to another user (" + std::to_string(status.st_uid) +
                                         "), who can change it: chown it");
  }
  const bool is_of_own_group = status.st_gid == ::getegid();
  const bool others_write = (status.st_mode & S_IWOTH) != 0 || ((status.st_mode & S_IWGRP) != 0 && !is_of_own_group);
  if (!others_write || (S_ISDIR(status.st_mode) && (status.st_mode & S_ISVTX) != 0)) return {};
  const std::string remedy = HasPermissions(path)
                                 ? "chmod go-w " + path.string()
                                 : "its file system (FAT or similar) has no permissions: use a disk with them, such as "
                                   "ext4";
  return Fail(ErrorCode::kInvalid, path.string() + ": other users may write it: " + remedy);
}

// Checks the folder in which `path` is an entry.
Result<void> CheckFolderOf(const std::filesystem::path& path) {
  const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
  struct stat status {};
  if (::stat(folder.c_str(), &status) != 0) return {};
  const Result<void> checked = CheckEntry(folder, status);
  if (checked) return {};
  return Fail(checked.error().code,
              path.string() + ": other users could replace it. Its folder " + checked.error().text);
}

}  // namespace

Result<void> CheckTrusted(const std::filesystem::path& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return {};
  if (const Result<void> checked = CheckEntry(path, status); !checked) return checked;
  if (S_ISDIR(status.st_mode)) return {};
  if (const Result<void> checked = CheckFolderOf(path); !checked) return checked;
  // If the path is a link, check the folder of the file behind it too.
  std::error_code failure;
  const std::filesystem::path target = std::filesystem::canonical(path, failure);
  return failure ? Result<void>() : CheckFolderOf(target);
}

}  // namespace moondb
