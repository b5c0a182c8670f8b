#include "apps/common/data_folder.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "model/text.h"

namespace moondb {
namespace {

constexpr char kPidFile[] = "agent.pid";

// Over the whole file; unlike flock it can be asked about without being taken for a moment, in which an agent that
// starts would find it taken. The kernel's answer is in the type.
struct flock LockOf(short type) {
  struct flock lock {};
  lock.l_type = type;
  lock.l_whence = SEEK_SET;
  return lock;
}

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
  struct flock lock = LockOf(F_RDLCK);
  const bool is_free = ::fcntl(descriptor, F_OFD_GETLK, &lock) == 0 && lock.l_type == F_UNLCK;
  const pid_t pid = is_free ? 0 : ReadPid(descriptor);
  ::close(descriptor);
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
  struct flock wanted = LockOf(F_WRLCK);
  if (::fcntl(descriptor, F_OFD_SETLK, &wanted) != 0) {
    if (errno != EAGAIN && errno != EACCES) return Fail(ErrorCode::kInternal, ErrnoText(), file);
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
