#include "runtime/team/new_files.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace moondb {
namespace {

Result<void> SystemFailure(const std::filesystem::path& path) {
  if (errno == EEXIST) return Fail(ErrorCode::kRefused, path.string() + ": exists already and is left as it is");
  return Fail(ErrorCode::kInternal, path.string() + ": " + std::strerror(errno));
}

bool WriteAll(int file, const std::string& content) {
  std::size_t done = 0;
  while (done < content.size()) {
    const ssize_t written = write(file, content.data() + done, content.size() - done);
    if (written < 0 && errno != EINTR) return false;
    if (written > 0) done += static_cast<std::size_t>(written);
  }
  return true;
}

}  // namespace

Result<void> WriteNewFile(const std::filesystem::path& path, const std::string& content, mode_t mode,
                          const std::optional<FileOwner>& owner) {
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
  if (file < 0) return SystemFailure(path);
  const bool is_owned = !owner || fchown(file, owner->user, owner->group) == 0;
  // Set the mode explicitly: the umask must not decide who can read the file.
  const bool is_written = is_owned && fchmod(file, mode) == 0 && WriteAll(file, content) && fsync(file) == 0;
  const int error = errno;
  const bool is_closed = close(file) == 0;
  if (is_written && is_closed) return {};
  if (!is_written) errno = error;
  return SystemFailure(path);
}

NewFiles::~NewFiles() {
  for (const File& file : files_) (void)unlink(file.aside.c_str());
}

Result<void> NewFiles::Add(const std::filesystem::path& path, const std::string& content, mode_t mode) {
  struct stat status {};
  if (lstat(path.c_str(), &status) == 0) {
    errno = EEXIST;
    return SystemFailure(path);
  }
  std::error_code no_folder;
  const std::filesystem::path folder = path.parent_path();
  if (!folder.empty() && std::filesystem::create_directories(folder, no_folder)) {
    std::filesystem::permissions(folder, std::filesystem::perms::owner_all, no_folder);
  }
  if (no_folder)
    return Fail(ErrorCode::kInternal, folder.string() + ": the folder cannot be made: " + no_folder.message());
  const std::filesystem::path aside = path.string() + ".new-" + std::to_string(getpid());
  const Result<void> written = WriteNewFile(aside, content, mode);
  if (written || written.error().code != ErrorCode::kRefused) files_.push_back({aside, path});
  return written;
}

void NewFiles::TakeBack() {
  for (const File& file : files_) (void)unlink(file.path.c_str());
}

Result<void> NewFiles::Publish() {
  for (std::size_t i = 0; i < files_.size(); ++i) {
    // Link, not rename: a rename would silently replace a file that appeared since Add.
    if (link(files_[i].aside.c_str(), files_[i].path.c_str()) == 0) continue;
    const Result<void> failure = SystemFailure(files_[i].path);
    for (std::size_t j = 0; j < i; ++j) (void)unlink(files_[j].path.c_str());
    return failure;
  }
  return {};
}

}  // namespace moondb
