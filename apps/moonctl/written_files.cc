#include "apps/moonctl/written_files.h"

#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <cerrno>

#include "model/text.h"

namespace moondb {
namespace {

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

Result<void> WriteThenRename(const std::vector<FileBytes>& files) {
  for (const FileBytes& file : files) {
    if (auto done = WriteTextFile(AsideOf(file), file.bytes); !done) {
      return Fail(done.error().code, done.error().text, file.file.string());
    }
  }
  for (const FileBytes& file : files) {
    std::error_code failure;
    std::filesystem::rename(AsideOf(file), file.file, failure);
    if (failure) return Fail(ErrorCode::kInternal, "cannot be written: " + failure.message(), file.file.string());
  }
  return {};
}

}  // namespace

Result<void> WriteTogether(const std::filesystem::path& folder, const std::vector<FileBytes>& files) {
  const HeldSignals held;
  std::error_code failure;
  if (!folder.empty()) std::filesystem::create_directories(folder, failure);
  if (failure) {
    return Fail(ErrorCode::kInternal, "the folder cannot be made: " + failure.message() + "; choose another one",
                folder.string());
  }
  if (auto done = WriteThenRename(files); !done) {
    for (const FileBytes& file : files) std::filesystem::remove(AsideOf(file), failure);
    return Fail(done.error().code, done.error().text + "; choose another folder, or make room", done.error().field);
  }
  return {};
}

Result<void> ReplaceFile(const std::filesystem::path& file, const std::string& bytes) {
  const HeldSignals held;
  const auto failed = [&file](const std::error_code& failure) {
    return Fail(ErrorCode::kInternal, "cannot be written: " + failure.message(), file.string());
  };
  std::error_code failure;
  const std::filesystem::path target = std::filesystem::canonical(file, failure);
  if (failure) return failed(failure);
  const auto mode = std::filesystem::status(target, failure).permissions();
  if (failure) return failed(failure);
  const std::filesystem::path aside = AsideOf({target, ""});
  if (auto done = WriteTextFile(aside, bytes); !done) return Fail(done.error().code, done.error().text, file.string());
  std::filesystem::permissions(aside, mode, failure);
  const int descriptor = failure ? -1 : ::open(aside.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor >= 0 && ::fsync(descriptor) != 0) failure = std::error_code(errno, std::generic_category());
  if (descriptor >= 0) ::close(descriptor);
  if (!failure) std::filesystem::rename(aside, target, failure);
  if (!failure) return {};
  std::error_code ignored;
  std::filesystem::remove(aside, ignored);
  return failed(failure);
}

}  // namespace moondb
