#include "model/file_writing.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/statfs.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>

namespace moondb {
namespace {

constexpr mode_t kExportedFile = 0644;
constexpr mode_t kExportedFolder = 0755;

// f_type of statfs(2): FAT, exFAT, NTFS by the kernel, and FUSE (NTFS by ntfs-3g).
constexpr std::array<std::uint32_t, 4> kWithoutPermissions = {0x4d44, 0x2011bab0, 0x7366746e, 0x65735546};

std::error_code LastError() { return {errno, std::generic_category()}; }

bool WriteAll(int file, std::string_view content) {
  while (!content.empty()) {
    const ssize_t written = write(file, content.data(), content.size());
    if (written < 0 && errno != EINTR) return false;
    if (written > 0) content.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

}  // namespace

std::error_code SetFolderMode(const std::filesystem::path& folder, mode_t mode) {
  const int descriptor = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
  if (descriptor < 0) return LastError();
  const std::error_code failure = fchmod(descriptor, mode) == 0 ? std::error_code() : LastError();
  close(descriptor);
  return failure;
}

std::error_code WriteNew(const std::filesystem::path& path, std::string_view content, const WriteOptions& options) {
  // O_EXCL refuses every existing entry, a link too. O_NOFOLLOW states the same for readers of this line.
  const int file =
      open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, options.mode.value_or(kExportedFile));
  if (file < 0) return LastError();
  const bool is_owned = !options.owner || fchown(file, options.owner->user, options.owner->group) == 0;
  // Set the mode after the owner: fchown clears some bits of the mode.
  const bool has_mode = is_owned && (!options.mode || fchmod(file, *options.mode) == 0);
  const bool is_written = has_mode && WriteAll(file, content) && (!options.is_synced || fsync(file) == 0);
  std::error_code failure = is_written ? std::error_code() : LastError();
  if (close(file) != 0 && !failure) failure = LastError();
  if (failure) (void)unlink(path.c_str());
  return failure;
}

std::error_code WriteTemporary(const std::filesystem::path& path, std::string_view content,
                               const WriteOptions& options) {
  if (unlink(path.c_str()) != 0 && errno != ENOENT) return LastError();
  return WriteNew(path, content, options);
}

std::error_code MoveToNew(const std::filesystem::path& from, const std::filesystem::path& to) {
  const auto lacks_support = [] {
    return errno == EINVAL || errno == ENOSYS || errno == EPERM || errno == EOPNOTSUPP || errno == EMLINK;
  };
  if (renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return {};
  if (!lacks_support()) return LastError();
  if (link(from.c_str(), to.c_str()) == 0) return unlink(from.c_str()) == 0 ? std::error_code() : LastError();
  if (!lacks_support()) return LastError();
  // The name is taken by an empty file of this process, which the rename replaces.
  if (const std::error_code taken = WriteNew(to, "", {.mode = 0600})) return taken;
  if (rename(from.c_str(), to.c_str()) == 0) return {};
  const std::error_code failure = LastError();
  (void)unlink(to.c_str());
  return failure;
}

bool HasPermissions(const std::filesystem::path& path) {
  struct statfs system {};
  if (statfs(path.c_str(), &system) != 0) return true;
  return std::ranges::find(kWithoutPermissions, static_cast<std::uint32_t>(system.f_type)) == kWithoutPermissions.end();
}

Result<void> WriteWholeFile(const std::filesystem::path& file, std::string_view content, const WriteOptions& options) {
  std::filesystem::path beside = file;
  beside += ".part";
  std::error_code failure = WriteTemporary(beside, content, options);
  if (!failure) {
    std::filesystem::rename(beside, file, failure);
    if (failure) (void)unlink(beside.c_str());
  }
  if (!failure) return {};
  return Fail(ErrorCode::kInternal, "cannot be written: " + failure.message(), file.string());
}

std::error_code MakeFolders(const std::filesystem::path& path, std::optional<mode_t> mode) {
  std::filesystem::path made;
  for (const std::filesystem::path& part : path) {
    made /= part;
    if (mkdir(made.c_str(), mode.value_or(kExportedFolder)) == 0) {
      const std::error_code failure = mode ? SetFolderMode(made, *mode) : std::error_code();
      if (failure) return failure;
      continue;
    }
    const int error = errno;
    struct stat status {};
    // mkdir may report EROFS or EACCES instead of EEXIST for a folder that exists.
    if (stat(made.c_str(), &status) != 0) return {error, std::generic_category()};
    if (!S_ISDIR(status.st_mode)) return {ENOTDIR, std::generic_category()};
  }
  return {};
}

}  // namespace moondb
