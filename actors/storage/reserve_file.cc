#include "actors/storage/reserve_file.h"

#include <sqlite3.h>

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <utility>
#include <vector>

namespace moondb {

namespace {

constexpr std::uint64_t kPartOfDisk = 8;
// Bytes per write. A VFS accepts at most 128 KiB.
constexpr int kBlockBytes = 64 * 1024;

// A file of the VFS. The destructor closes it.
class OpenFile {
 public:
  OpenFile(sqlite3_vfs* vfs, const std::string& path, int flags)
      : memory_((static_cast<std::size_t>(vfs->szOsFile) + sizeof(std::max_align_t)) / sizeof(std::max_align_t)) {
    std::memset(memory_.data(), 0, memory_.size() * sizeof(std::max_align_t));
    // For a super-journal, the VFS takes no lock, and the first sync of the file also syncs the folder.
    code_ = vfs->xOpen(vfs, path.c_str(), file(), flags | SQLITE_OPEN_SUPER_JOURNAL, nullptr);
  }
  ~OpenFile() {
    if (file()->pMethods != nullptr) file()->pMethods->xClose(file());
  }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;

  int code() const { return code_; }
  sqlite3_file* file() { return reinterpret_cast<sqlite3_file*>(memory_.data()); }
  const sqlite3_io_methods& methods() { return *file()->pMethods; }

 private:
  std::vector<std::max_align_t> memory_;
  int code_ = SQLITE_OK;
};

}  // namespace

std::uint64_t ReserveBytesFor(std::uint64_t capacity_bytes) {
  return std::min(kReserveBytesMax, capacity_bytes / kPartOfDisk);
}

ReserveFile::ReserveFile(const std::string& database_path, std::string vfs) : vfs_(std::move(vfs)) {
  constexpr std::string_view kEnding = ".sqlite";
  if (database_path == ":memory:") return;
  path_ = database_path;
  if (path_.ends_with(kEnding)) path_.resize(path_.size() - kEnding.size());
  path_ += ".reserve";
}

std::uint64_t ReserveFile::Bytes() const {
  sqlite3_vfs* vfs = path_.empty() ? nullptr : sqlite3_vfs_find(vfs_.empty() ? nullptr : vfs_.c_str());
  int is_there = 0;
  if (vfs == nullptr || vfs->xAccess(vfs, path_.c_str(), SQLITE_ACCESS_EXISTS, &is_there) != SQLITE_OK) return 0;
  if (is_there == 0) return 0;
  OpenFile reserve(vfs, path_, SQLITE_OPEN_READONLY);
  sqlite3_int64 bytes = 0;
  const bool is_read = reserve.code() == SQLITE_OK && reserve.methods().xFileSize(reserve.file(), &bytes) == SQLITE_OK;
  return is_read ? static_cast<std::uint64_t>(bytes) : 0;
}

Result<void> ReserveFile::Grow(std::uint64_t goal, std::mt19937_64& random) {
  sqlite3_vfs* vfs = path_.empty() ? nullptr : sqlite3_vfs_find(vfs_.empty() ? nullptr : vfs_.c_str());
  if (vfs == nullptr) return {};
  OpenFile reserve(vfs, path_, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE);
  int code = reserve.code();
  sqlite3_int64 bytes = 0;
  if (code == SQLITE_OK) code = reserve.methods().xFileSize(reserve.file(), &bytes);
  auto size = static_cast<std::uint64_t>(bytes);
  const std::uint64_t end = std::min(size + kReservePartBytes, goal);
  std::vector<std::uint64_t> block(kBlockBytes / sizeof(std::uint64_t));
  for (; code == SQLITE_OK && size < end; size += kBlockBytes) {
    std::generate(block.begin(), block.end(), std::ref(random));
    code = reserve.methods().xWrite(reserve.file(), block.data(), kBlockBytes, static_cast<sqlite3_int64>(size));
  }
  if (code == SQLITE_OK) code = reserve.methods().xSync(reserve.file(), SQLITE_SYNC_NORMAL);
  if (code == SQLITE_OK) return {};
  const bool is_full = (code & 0xFF) == SQLITE_FULL;
  return Fail(is_full ? ErrorCode::kFull : ErrorCode::kInternal, path_ + ": " + sqlite3_errstr(code));
}

bool ReserveFile::GiveUp() {
  sqlite3_vfs* vfs = path_.empty() ? nullptr : sqlite3_vfs_find(vfs_.empty() ? nullptr : vfs_.c_str());
  return vfs != nullptr && Bytes() > 0 && vfs->xDelete(vfs, path_.c_str(), /*syncDir=*/1) == SQLITE_OK;
}

}  // namespace moondb
