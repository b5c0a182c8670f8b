#include "apps/moonctl/written_files.h"

#include <signal.h>

#include "model/text.h"

namespace moondb {
namespace {

// What would end the process waits while this lives.
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

}  // namespace moondb
