#include "apps/common/data_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <utility>
#include <vector>

#include "client/endpoint.h"
#include "model/file_writing.h"
#include "model/team_id.h"
#include "model/text.h"
#include "runtime/team/team_check.h"
#include "runtime/team/trusted_file.h"

namespace moondb {
namespace {

constexpr char kPidFile[] = "agent.pid";
constexpr char kIdentityFile[] = "agent.identity";
constexpr std::string_view kTeamIdKey = "team_id: ";
constexpr std::string_view kAgentIdKey = "agent_id: ";
constexpr std::size_t kSmallFileBytesMax = 4096;
constexpr mode_t kPrivateFile = 0600;
constexpr mode_t kPrivateFolder = 0700;

// Returns a lock of the whole file for fcntl. `type` is F_RDLCK or F_WRLCK. Unlike a flock, a lock of fcntl can be
// queried without being taken. A query that takes the lock could make a starting agent fail.
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

// Returns the id of the process that holds the folder's flock, read from /proc/locks. 0: /proc/locks lists no such
// process.
pid_t HolderOf(const std::filesystem::path& folder) {
  struct stat status {};
  if (::stat(folder.c_str(), &status) != 0) return 0;
  char wanted[64];
  std::snprintf(wanted, sizeof wanted, "%02x:%02x:%llu", major(status.st_dev), minor(status.st_dev),
                static_cast<unsigned long long>(status.st_ino));
  std::ifstream locks("/proc/locks");
  // Example of a line: "1: FLOCK  ADVISORY  WRITE 2443 00:1f:1234 0 EOF".
  std::string number, kind, advisory, write, pid, place, rest;
  while (locks >> number >> kind) {
    if (kind == "->") locks >> kind;  // The line describes a process that waits for a lock.
    locks >> advisory >> write >> pid >> place;
    std::getline(locks, rest);
    if (kind != "FLOCK" || write != "WRITE" || place != wanted) continue;
    return static_cast<pid_t>(ParseUnsigned(pid).value_or(0));
  }
  return 0;
}

// Writes this process's id over the old content of the file, because a full disk has no space for another block.
// Empties the file if writing fails. Returns false if another process's id may remain in the file.
bool WritePid(int descriptor) {
  const std::string pid = std::to_string(::getpid()) + "\n";
  const auto size = static_cast<off_t>(pid.size());
  const bool is_written = ::pwrite(descriptor, pid.data(), pid.size(), 0) == static_cast<ssize_t>(pid.size()) &&
                          ::ftruncate(descriptor, size) == 0;
  return is_written || ::ftruncate(descriptor, 0) == 0;
}

Error AnothersData(const std::filesystem::path& folder, const DataOwner& owner, const DataOwner& wanted) {
  const auto start = [](const DataOwner& of) { return TeamIdStart(TeamIdBytes(of.team_id)); };
  std::string text = "holds the data of agent " + std::to_string(owner.agent);
  if (owner.team_id != wanted.team_id) {
    text += " of another team (its team id begins with " + start(owner) + ", this team's with " + start(wanted) + ")";
  } else {
    text += ", not of agent " + std::to_string(wanted.agent);
  }
  return {ErrorCode::kRefused, text, folder.string()};
}

}  // namespace

std::filesystem::path DefaultDataRoot(const std::filesystem::path& team_folder) {
  return std::filesystem::absolute(team_folder).lexically_normal() / "moondb-data";
}

DataOwner DataOwnerOf(const proto::TeamConfig& team, const proto::AgentConfig& agent) {
  return {team.team_id(), agent.id()};
}

std::optional<DataOwner> ReadDataOwner(const std::filesystem::path& folder) {
  const auto text = ReadTextFile(folder / kIdentityFile, kSmallFileBytesMax);
  if (!text) return std::nullopt;
  DataOwner owner;
  std::string_view rest = *text;
  while (!rest.empty()) {
    const std::string_view line = TakeLine(rest);
    if (line.starts_with(kTeamIdKey)) owner.team_id = line.substr(kTeamIdKey.size());
    if (!line.starts_with(kAgentIdKey)) continue;
    const auto id = ParseUnsigned(line.substr(kAgentIdKey.size()));
    if (id && *id <= kAgentIdMax) owner.agent = static_cast<AgentId>(*id);
  }
  return owner.agent == 0 ? std::nullopt : std::optional(owner);
}

Result<std::filesystem::path> FindDataFolder(const std::filesystem::path& root, const proto::TeamConfig& team,
                                             const proto::AgentConfig& agent) {
  const DataOwner wanted = DataOwnerOf(team, agent);
  const std::filesystem::path by_name = root / agent.name();
  const auto named = ReadDataOwner(by_name);
  if (named == wanted) return by_name;
  std::vector<std::filesystem::path> found;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(root, error), end; !error && entry != end; entry.increment(error)) {
    const std::filesystem::path& folder = entry->path();
    if (IsPlainName(folder.filename().string()) && ReadDataOwner(folder) == wanted) found.push_back(folder);
  }
  if (found.size() > 1) {
    return Fail(ErrorCode::kRefused,
                "holds data of agent " + std::to_string(agent.id()) + "; so does the folder " +
                    found[1].filename().string() + "; move one of the two elsewhere",
                found[0].string());
  }
  if (!found.empty()) return found.front();
  if (!named) return by_name;
  if (named->team_id != wanted.team_id) return tl::unexpected(AnothersData(by_name, *named, wanted));
  return root / (agent.name() + "-" + std::to_string(agent.id()));
}

Result<void> MarkDataFolder(const std::filesystem::path& folder, const DataOwner& owner) {
  const auto known = ReadDataOwner(folder);
  if (known == owner) return {};
  if (known) return tl::unexpected(AnothersData(folder, *known, owner));
  const std::string text =
      std::string(kTeamIdKey) + owner.team_id + "\n" + std::string(kAgentIdKey) + std::to_string(owner.agent) + "\n";
  return WriteWholeFile(folder / kIdentityFile, text, {.mode = kPrivateFile});
}

Result<void> MakeDataFolder(const std::filesystem::path& folder) {
  const std::error_code failure = MakeFolders(folder, kPrivateFolder);
  if (!failure) return {};
  return Fail(ErrorCode::kInternal, "cannot make the folder: " + failure.message(), folder.string());
}

Result<void> WriteEndpoint(const std::filesystem::path& folder, const std::string& endpoint) {
  if (ReadEndpoint(folder) == endpoint) return {};
  return WriteWholeFile(folder / kEndpointFile, endpoint + "\n", {.mode = kPrivateFile});
}

pid_t OwnerOf(const std::filesystem::path& folder) {
  const int descriptor = ::open((folder / kPidFile).c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
  if (descriptor < 0) return HolderOf(folder);
  struct flock lock = LockOf(F_RDLCK);
  const bool is_free = ::fcntl(descriptor, F_OFD_GETLK, &lock) == 0 && lock.l_type == F_UNLCK;
  const pid_t pid = is_free ? 0 : ReadPid(descriptor);
  ::close(descriptor);
  return pid != 0 ? pid : HolderOf(folder);
}

Result<DataFolderLock> DataFolderLock::Take(const std::filesystem::path& folder) {
  if (const Result<void> made = MakeDataFolder(folder); !made) return tl::unexpected(made.error());
  if (const Result<void> trusted = CheckTrusted(folder); !trusted) return tl::unexpected(trusted.error());
  const auto refuse = [&folder] {
    return Fail(ErrorCode::kRefused,
                "the data folder is in use by another agent process (pid " + std::to_string(OwnerOf(folder)) + ")",
                folder.string());
  };

  DataFolderLock lock(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (lock.folder_ < 0) return Fail(ErrorCode::kInternal, ErrnoText(), folder.string());
  const bool is_folder_locked = ::flock(lock.folder_, LOCK_EX | LOCK_NB) == 0;
  if (!is_folder_locked && errno == EWOULDBLOCK) return refuse();

  const std::string file = folder / kPidFile;
  const int descriptor = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
  // The flock of the folder suffices if `agent.pid` cannot be opened because the disk is full, faulty or read-only. If
  // both locks fail, Take fails. Some network file systems do not support flock of folders.
  if (descriptor < 0 && is_folder_locked && (errno == EROFS || errno == ENOSPC || errno == EIO)) return lock;
  if (descriptor < 0) return Fail(ErrorCode::kInternal, ErrnoText(), file);
  lock.descriptor_ = descriptor;
  struct flock wanted = LockOf(F_WRLCK);
  if (::fcntl(descriptor, F_OFD_SETLK, &wanted) != 0) {
    if (errno != EAGAIN && errno != EACCES) return Fail(ErrorCode::kInternal, ErrnoText(), file);
    return refuse();
  }
  if (WritePid(descriptor)) return lock;
  if (!is_folder_locked) return Fail(ErrorCode::kInternal, ErrnoText(), file);
  // The file may still hold another process's id. Release the file's lock, so that OwnerOf ignores this id and reports
  // the process that holds the folder's flock.
  ::close(std::exchange(lock.descriptor_, -1));
  return lock;
}

DataFolderLock::DataFolderLock(DataFolderLock&& other) noexcept
    : folder_(std::exchange(other.folder_, -1)), descriptor_(std::exchange(other.descriptor_, -1)) {}

DataFolderLock::~DataFolderLock() {
  if (descriptor_ >= 0) ::close(descriptor_);
  if (folder_ >= 0) ::close(folder_);
}

}  // namespace moondb
