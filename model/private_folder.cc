#include "model/private_folder.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "model/file_writing.h"

namespace moondb {
namespace {

constexpr mode_t kOwnerOnly = S_IRWXU;

bool IsTrusted(uid_t user) { return user == geteuid() || user == 0; }

}  // namespace

Result<void> CheckPrivateFolder(const std::filesystem::path& folder) {
  struct stat status {};
  if (lstat(folder.c_str(), &status) != 0) {
    if (errno == ENOENT) return {};
    return Fail(ErrorCode::kInvalid, folder.string() + ": " + std::strerror(errno));
  }
  const bool is_own_folder = S_ISDIR(status.st_mode) && status.st_uid == geteuid();
  if (!is_own_folder || (status.st_mode & (S_IRWXG | S_IRWXO)) != 0) {
    return Fail(ErrorCode::kInvalid, folder.string() + ": must be a folder of this user's with mode 0700");
  }
  // If the parent is a link, also check the owner of the link, who can redirect the link to another folder.
  const std::filesystem::path parent = folder.parent_path();
  struct stat link {};
  if (lstat(parent.c_str(), &link) != 0 || stat(parent.c_str(), &status) != 0) {
    return Fail(ErrorCode::kInvalid, parent.string() + ": " + std::strerror(errno));
  }
  const bool is_trusted = IsTrusted(link.st_uid) && IsTrusted(status.st_uid);
  const bool is_replaceable = (status.st_mode & (S_IWGRP | S_IWOTH)) != 0 && (status.st_mode & S_ISVTX) == 0;
  if (!is_trusted || is_replaceable) {
    return Fail(ErrorCode::kInvalid,
                parent.string() + ": other users could replace the folder " + folder.filename().string() + " in it");
  }
  return {};
}

Result<void> MakePrivateFolder(const std::filesystem::path& folder) {
  // Make each level with mode 0700, so that no other user can replace it.
  if (const std::error_code failure = MakeFolders(folder, kOwnerOnly)) {
    return Fail(ErrorCode::kInvalid, folder.string() + ": " + failure.message());
  }
  return CheckPrivateFolder(folder);
}

}  // namespace moondb
