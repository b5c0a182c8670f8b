#include "runtime/team/new_files.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace moondb {
namespace {

Result<void> FailureAt(const std::filesystem::path& path, int error) {
  if (error == EEXIST) return Fail(ErrorCode::kRefused, path.string() + ": exists already and is left as it is");
  return Fail(ErrorCode::kInternal, path.string() + ": " + std::strerror(error));
}

}  // namespace

Result<void> WriteNewFile(const std::filesystem::path& path, const std::string& content, mode_t mode,
                          const std::optional<FileOwner>& owner) {
  const std::error_code failure = WriteNew(path, content, {.mode = mode, .owner = owner, .is_synced = true});
  if (failure) return FailureAt(path, failure.value());
  return {};
}

NewFiles::~NewFiles() {
  for (const File& file : files_) (void)unlink(file.aside.c_str());
}

Result<void> NewFiles::Add(const std::filesystem::path& path, const std::string& content, mode_t mode) {
  struct stat status {};
  if (lstat(path.c_str(), &status) == 0) {
    return FailureAt(path, EEXIST);
  }
  const std::filesystem::path folder = path.parent_path();
  if (const std::error_code no_folder = MakeFolders(folder, S_IRWXU)) {
    return Fail(ErrorCode::kInternal, folder.string() + ": the folder cannot be made: " + no_folder.message());
  }
  const std::filesystem::path aside = path.string() + ".new-" + std::to_string(getpid());
  const Result<void> written = WriteNewFile(aside, content, mode);
  if (written) files_.push_back({aside, path});
  return written;
}

void NewFiles::TakeBack() {
  for (const File& file : files_) (void)unlink(file.path.c_str());
}

Result<void> NewFiles::Publish() {
  for (std::size_t i = 0; i < files_.size(); ++i) {
    // A plain rename would silently replace a file that appeared since Add.
    const std::error_code failed = MoveToNew(files_[i].aside, files_[i].path);
    if (!failed) continue;
    const Result<void> failure = FailureAt(files_[i].path, failed.value());
    for (std::size_t j = 0; j < i; ++j) (void)unlink(files_[j].path.c_str());
    return failure;
  }
  return {};
}

}  // namespace moondb
