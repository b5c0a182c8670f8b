#include "runtime/team/trusted_file.h"

#include <sys/stat.h>
#include <unistd.h>

#include <string>

namespace moondb {

Result<void> CheckTrusted(const std::filesystem::path& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return {};
  if (status.st_uid != ::geteuid() && status.st_uid != 0 && ::geteuid() != 0) {
    return Fail(ErrorCode::kInvalid, path.string() + ": belongs to another user (" + std::to_string(status.st_uid) +
                                         "), who can change it: chown it");
  }
  const bool is_of_own_group = status.st_gid == ::getegid();
  const bool others_write = (status.st_mode & S_IWOTH) != 0 || ((status.st_mode & S_IWGRP) != 0 && !is_of_own_group);
  if (!others_write || (S_ISDIR(status.st_mode) && (status.st_mode & S_ISVTX) != 0)) return {};
  return Fail(ErrorCode::kInvalid, path.string() + ": other users may write it: chmod go-w " + path.string());
}

}  // namespace moondb
