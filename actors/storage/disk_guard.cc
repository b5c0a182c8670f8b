#include "actors/storage/disk_guard.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <utility>
#include <vector>

#include "proto/status.pb.h"

namespace moondb {

namespace {

constexpr double kBytesPerMegabyte = 1e6;
constexpr std::size_t kDeletableMax = 4;  // Maximum number of files named in one message.

constexpr std::uint64_t OthersMapFloor(std::uint64_t reserve_bytes) { return 3 * reserve_bytes; }
constexpr std::uint64_t MapFloor(std::uint64_t reserve_bytes) { return 2 * reserve_bytes; }
constexpr std::uint64_t RecordFloor(std::uint64_t reserve_bytes) { return reserve_bytes / 2; }
constexpr std::uint64_t LogFloor(std::uint64_t reserve_bytes) { return reserve_bytes / 4; }

std::string DiskMegabytes(std::uint64_t bytes) {
  char text[32];
  const double megabytes = static_cast<double>(bytes) / kBytesPerMegabyte;
  std::snprintf(text, sizeof text, megabytes < 10 ? "%.1f MB" : "%.0f MB", megabytes);
  return text;
}

}  // namespace

bool IsOfTheDisk(const Error& error) { return error.code == ErrorCode::kFull || error.code == ErrorCode::kInternal; }

std::string DeletableFiles(const std::string& database_path) {
  const std::filesystem::path path(database_path);
  const std::string damaged = path.filename().string() + ".damaged-";
  std::vector<std::pair<std::uint64_t, std::string>> files;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(path.parent_path(), error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (!name.starts_with(damaged) && !name.starts_with("agent.log") && name != "trace.txt") continue;
    std::error_code size_error;
    const std::uintmax_t bytes = entry->file_size(size_error);
    if (!size_error && bytes > 0) files.emplace_back(bytes, name);
  }
  std::sort(files.rbegin(), files.rend());
  std::string text;
  for (std::size_t i = 0; i < std::min(files.size(), kDeletableMax); ++i) {
    text += (i == 0 ? "" : ", ") + files[i].second + " (" + DiskMegabytes(files[i].first) + ")";
  }
  return text.empty() ? "" : text + " in " + path.parent_path().string();
}

DiskGuard::DiskGuard(const std::string& database_path, const std::string& vfs, std::string agent)
    : path_(database_path),
      is_on_disk_(vfs.empty() && database_path != ":memory:"),
      agent_(std::move(agent)),
      reserve_(database_path, vfs) {}

std::optional<DiskGuard::Room> DiskGuard::RoomOf(Database& database) const {
  const std::optional<DiskSpace> space = database.GetDiskSpace();
  if (!space) return std::nullopt;
  Room room;
  room.disk_bytes = room.bytes = space->free_bytes;
  room.reserve_bytes = ReserveBytesFor(space->capacity_bytes);
  // If the disk has more room than any limit requires, the free pages of the file do not matter.
  if (room.bytes >= OthersMapFloor(room.reserve_bytes)) return room;
  room.bytes += database.FreePageBytes().value_or(0);
  room.log_bytes = database.WalBytes();
  return room;
}

Result<void> DiskGuard::CheckRoom(Database& database, Kind kind) const {
  if (database.access() == Database::Access::kReadOnly) {
    return Fail(ErrorCode::kInternal, "nothing can be stored: the file system of " + path_ + " is read-only");
  }
  const std::optional<Room> room = RoomOf(database);
  if (!room) return {};
  const bool is_short = room->bytes < RecordFloor(room->reserve_bytes) ||
                        room->disk_bytes + room->log_bytes < LogFloor(room->reserve_bytes);
  if (is_short) {
    return Fail(
        ErrorCode::kFull,
        "the disk is full (" + DiskMegabytes(room->disk_bytes) +
            " are free): no records are accepted, because the remaining space is reserved for role assignments; " +
            Advice());
  }
  const std::string nearly_full = "the disk is nearly full (" + DiskMegabytes(room->disk_bytes) + " are free): ";
  if (kind != Kind::kRecord && room->bytes < MapFloor(room->reserve_bytes)) {
    return Fail(
        ErrorCode::kFull,
        nearly_full + "no more maps are accepted, because the remaining space is reserved for states; " + Advice());
  }
  if (kind == Kind::kOthersMap && room->bytes < OthersMapFloor(room->reserve_bytes)) {
    return Fail(ErrorCode::kFull,
                nearly_full +
                    "no more maps of other agents are accepted, because the remaining space is reserved for this " +
                    "agent's own records; " + Advice());
  }
  return {};
}

bool DiskGuard::MakeRoomForLog(Database& database) {
  const std::optional<Room> room = RoomOf(database);
  const bool is_log_short = room && room->bytes >= RecordFloor(room->reserve_bytes) &&
                            room->disk_bytes + room->log_bytes < LogFloor(room->reserve_bytes);
  return is_log_short && reserve_.Bytes() > 0 && GiveUpReserve(database);
}

bool DiskGuard::GiveUpReserve(Database& database) {
  is_reserve_whole_ = false;
  const bool was_there = reserve_.GiveUp();
  // The database file now has room to grow. Move the log into the file, so SQLite can reuse the log from its beginning.
  const bool is_moved = database.Checkpoint().has_value();
  return was_there || is_moved;
}

bool DiskGuard::ObserveFailure(const Database& database, const Error& error) {
  if (!IsOfTheDisk(error)) return false;
  std::string text = error.text;
  if (error.code == ErrorCode::kFull) text = "the disk is full";
  if (database.access() == Database::Access::kReadOnly || database.IsOnReadOnlyFileSystem()) {
    text = "the file system is read-only";
  }
  return std::exchange(trouble_, text) != text;
}

bool DiskGuard::ObserveSuccess() { return !std::exchange(trouble_, std::string()).empty(); }

bool DiskGuard::Tend(Database& database, std::mt19937_64& random) {
  if (database.access() == Database::Access::kReadOnly || !trouble_.empty() || is_reserve_whole_) return false;
  const std::optional<Room> room = RoomOf(database);
  if (!room) return false;
  const std::uint64_t present = reserve_.Bytes();
  is_reserve_whole_ = present >= room->reserve_bytes;
  if (is_reserve_whole_) return false;
  const std::uint64_t lacking = room->reserve_bytes - present;
  // Grow the reserve only if all records will still be accepted afterwards, and if the disk keeps room for the log.
  const bool has_room = room->bytes >= lacking + OthersMapFloor(room->reserve_bytes) &&
                        room->disk_bytes >= lacking + LogFloor(room->reserve_bytes);
  return has_room && reserve_.Grow(room->reserve_bytes, random).has_value();
}

void DiskGuard::Describe(Database& database, proto::StorageStatus& status) const {
  status.set_reserve_bytes(static_cast<double>(reserve_.Bytes()));
  if (const Result<void> room = CheckRoom(database, Kind::kOthersMap); !room) {
    status.set_refused_inserts(room.error().text);  // CheckRoom reports the lowest limit that is not met.
  }
  if (trouble_.empty()) return;
  status.set_write_trouble(trouble_ + (trouble_ == "the disk is full" ? ": " + Advice() : ""));
}

std::string DiskGuard::Advice() const {
  const std::string files = is_on_disk_ ? DeletableFiles(path_) : "";
  const std::string prune = "free space: moonctl -a " + agent_ + " db prune";
  return files.empty() ? prune : prune + ", or delete " + files;
}

}  // namespace moondb
