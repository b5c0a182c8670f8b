#include "apps/common/data_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "model/text.h"

namespace moondb {
namespace {

constexpr char kPidFile[] = "agent.pid";

std::string ErrnoText() { return std::strerror(errno); }

pid_t ReadPid(int descriptor) {
  char text[32] = {};
  const ssize_t length = ::pread(descriptor, text, sizeof(text) - 1, 0);
  if (length <= 0) return 0;
  std::string_view rest(text, static_cast<std::size_t>(length));
  const auto pid = ParseUnsigned(TakeLine(rest));
  return pid && *pid <= 0x7FFF'FFFF ? static_cast<pid_t>(*pid) : 0;
}

}  // namespace

std::filesystem::path DefaultDataFolder(const std::filesystem::path& team_file, const std::string& agent_name) {
  return std::filesystem::absolute(team_file).parent_path() / "moondb-data" / agent_name;
}

pid_t OwnerOf(const std::filesystem::path& folder) {
  const int descriptor = ::open((folder / kPidFile).c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return 0;
  const bool is_free = ::flock(descriptor, LOCK_SH | LOCK_NB) == 0;
  const pid_t pid = is_free ? 0 : ReadPid(descriptor);
  ::close(descriptor);  // Frees a lock taken by the question.
  return pid;
}

Result<DataFolderLock> DataFolderLock::Take(const std::filesystem::path& folder) {
  std::error_code error;
  const bool is_new = std::filesystem::create_directories(folder, error);
  if (error) return Fail(ErrorCode::kInternal, "cannot make the folder: " + error.message(), folder.string());
  if (is_new) ::chmod(folder.c_str(), 0700);

  const std::string file = folder / kPidFile;
  const int descriptor = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (descriptor < 0) return Fail(ErrorCode::kInternal, ErrnoText(), file);
  DataFolderLock lock(descriptor);
  if (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    if (errno != EWOULDBLOCK) return Fail(ErrorCode::kInternal, ErrnoText(), file);
    return Fail(ErrorCode::kRefused,
                "the data folder is in use by another agent process (pid " + std::to_string(ReadPid(descriptor)) + ")",
                folder.string());
  }
  const std::string pid = std::to_string(::getpid()) + "\n";
  if (::ftruncate(descriptor, 0) != 0 || ::pwrite(descriptor, pid.data(), pid.size(), 0) < 0) {
    return Fail(ErrorCode::kInternal, ErrnoText(), file);
  }
  return lock;
}

DataFolderLock::DataFolderLock(DataFolderLock&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}

DataFolderLock::~DataFolderLock() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

}  // namespace moondb
