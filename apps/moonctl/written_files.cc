#include "apps/moonctl/written_files.h"

#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <system_error>

#include "model/file_writing.h"

namespace moondb {
namespace {

constexpr int kLinksMax = 8;
// Bits of a replaced file's mode that the new file keeps. Other users never get the right to write.
constexpr mode_t kKeptMode = 0775;

// Blocks SIGINT, SIGTERM and SIGHUP while this object exists.
class HeldSignals {
 public:
  HeldSignals() {
    sigset_t held;
    ::sigemptyset(&held);
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) ::sigaddset(&held, signal);
    ::pthread_sigmask(SIG_BLOCK, &held, &before_);
  }
  ~HeldSignals() { ::pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  HeldSignals(const HeldSignals&) = delete;
  HeldSignals& operator=(const HeldSignals&) = delete;

 private:
  sigset_t before_;
};

std::filesystem::path AsideOf(const FileBytes& file) { return file.file.string() + ".new"; }

Result<void> CannotWrite(const std::filesystem::path& file, const std::error_code& failure) {
  return Fail(ErrorCode::kInternal, "cannot be written: " + failure.message(), file.string());
}

Result<void> WriteThenRename(const std::vector<FileBytes>& files) {
  for (const FileBytes& file : files) {
    if (const std::error_code failure = WriteTemporary(AsideOf(file), file.bytes, {})) {
      return CannotWrite(file.file, failure);
    }
  }
  for (const FileBytes& file : files) {
    std::error_code failure;
    std::filesystem::rename(AsideOf(file), file.file, failure);
    if (failure) return CannotWrite(file.file, failure);
  }
  return {};
}

// An existing file that is to be replaced.
struct Target {
  std::filesystem::path path;  // The file behind all links.
  struct stat status;
};

// Follows links of this user and of root only. Another user could direct a link to a file of this user's.
Result<Target> TargetOf(const std::filesystem::path& file) {
  std::filesystem::path path = file;
  for (int links = 0; links < kLinksMax; ++links) {
    const int entry = ::open(path.c_str(), O_PATH | O_NOFOLLOW | O_CLOEXEC);
    Target target{path, {}};
    std::array<char, PATH_MAX> to{};
    const bool is_read = entry >= 0 && ::fstat(entry, &target.status) == 0;
    const bool is_link = is_read && S_ISLNK(target.status.st_mode);
    const ssize_t size = is_link ? ::readlinkat(entry, "", to.data(), to.size()) : 0;
    const std::error_code failure(errno, std::generic_category());
    if (entry >= 0) ::close(entry);
    if (!is_read || size < 0) return tl::unexpected(CannotWrite(file, failure).error());
    if (!is_link) return target;
    if (target.status.st_uid != ::geteuid() && target.status.st_uid != 0) {
      return Fail(ErrorCode::kRefused,
                  "is a symbolic link of another user; remove the link, or give the path of its target", path.string());
    }
    path = path.parent_path() / std::string(to.data(), static_cast<std::size_t>(size));
  }
  return tl::unexpected(CannotWrite(file, std::make_error_code(std::errc::too_many_symbolic_link_levels)).error());
}

}  // namespace

Result<void> WriteTogether(const std::filesystem::path& folder, const std::vector<FileBytes>& files) {
  const HeldSignals held;
  std::error_code failure = MakeFolders(folder);
  if (failure) {
    return Fail(ErrorCode::kInternal, "the folder cannot be made: " + failure.message() + "; choose another one",
                folder.string());
  }
  if (auto done = WriteThenRename(files); !done) {
    for (const FileBytes& file : files) std::filesystem::remove(AsideOf(file), failure);
    return Fail(done.error().code, done.error().text + "; choose another folder, or free disk space",
                done.error().field);
  }
  return {};
}

Result<void> ReplaceFile(const std::filesystem::path& file, const std::string& bytes) {
  const HeldSignals held;
  const Result<Target> target = TargetOf(file);
  if (!target) return tl::unexpected(target.error());
  WriteOptions options{.mode = target->status.st_mode & kKeptMode, .is_synced = true};
  const bool is_own = target->status.st_uid == ::geteuid() && target->status.st_gid == ::getegid();
  if (::geteuid() == 0 && !is_own) options.owner = FileOwner{target->status.st_uid, target->status.st_gid};
  const std::filesystem::path aside = AsideOf({target->path, ""});
  std::error_code failure = WriteTemporary(aside, bytes, options);
  if (failure) return CannotWrite(file, failure);
  std::filesystem::rename(aside, target->path, failure);
  if (!failure) return {};
  std::error_code ignored;
  std::filesystem::remove(aside, ignored);
  return CannotWrite(file, failure);
}

}  // namespace moondb
