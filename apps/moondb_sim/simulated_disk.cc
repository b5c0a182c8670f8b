#include "apps/moondb_sim/simulated_disk.h"

#include <sqlite3.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <vector>

#include "actors/storage/sqlite_database.h"
#include "model/check.h"

namespace moondb::simulation {
namespace {

constexpr int kSectorBytes = 512;
constexpr std::uint64_t kCapacityBytes = 4 << 20;  // Reported disk capacity, from which storage derives its reserve.
constexpr double kJulianDay2026 = 2461041.5;       // Julian day of 2026-01-01 UTC.

std::atomic<std::uint64_t> disk_count = 0;

}  // namespace

struct SimulatedDisk::File {
  // An unsynced write or truncation, with the content that it replaced.
  struct Change {
    std::size_t offset = 0;
    std::string now;
    std::string before;  // Replaced bytes.
    std::size_t size_before = 0;
    bool is_truncation = false;  // True if the file was cut to `offset`.
  };

  std::string path;
  std::string content;
  std::vector<Change> unsynced;
  int generation = 0;  // Number of power cuts. Handles from before the last cut fail.

  void Apply(const Change& change) {
    if (change.is_truncation) {
      content.resize(std::min(content.size(), change.offset));
      return;
    }
    if (content.size() < change.offset + change.now.size()) content.resize(change.offset + change.now.size(), '\0');
    content.replace(change.offset, change.now.size(), change.now);
  }

  void Write(std::size_t offset, std::string bytes) {
    Change change{offset, std::move(bytes), {}, content.size(), false};
    if (offset < content.size()) change.before = content.substr(offset, change.now.size());
    Apply(change);
    unsynced.push_back(std::move(change));
  }

  void Truncate(std::size_t size) {
    Change change{size, {}, {}, content.size(), true};
    if (size < content.size()) change.before = content.substr(size);
    Apply(change);
    unsynced.push_back(std::move(change));
  }

  // Returns the content as of the last sync.
  std::string Synced() const {
    File file;
    file.content = content;
    for (auto change = unsynced.rbegin(); change != unsynced.rend(); ++change) {
      file.content.resize(change->size_before, '\0');
      file.content.replace(change->offset, change->before.size(), change->before);
    }
    return file.content;
  }
};

struct SimulatedDisk::Vfs {
  sqlite3_vfs vfs{};
};

struct DiskCalls {
  using File = SimulatedDisk::File;
  struct OpenFile {
    sqlite3_file base;  // SQLite's own struct, which must come first.
    SimulatedDisk* disk;
    std::shared_ptr<File>* file;
    int generation;
  };

  static OpenFile& Of(sqlite3_file* file) { return *reinterpret_cast<OpenFile*>(file); }
  static SimulatedDisk& DiskOf(sqlite3_vfs* vfs) { return *static_cast<SimulatedDisk*>(vfs->pAppData); }
  static File* Live(sqlite3_file* file) {
    OpenFile& open = Of(file);
    return (*open.file)->generation == open.generation ? open.file->get() : nullptr;
  }

  // Methods of an open file (sqlite3_io_methods).
  static int Close(sqlite3_file* file) {
    delete Of(file).file;
    return SQLITE_OK;
  }
  static int Read(sqlite3_file* handle, void* bytes, int count, sqlite3_int64 offset) {
    const File* file = Live(handle);
    if (file == nullptr) return SQLITE_IOERR_READ;
    const auto size = static_cast<std::size_t>(count);
    const auto first = static_cast<std::size_t>(offset);
    const std::size_t have = first < file->content.size() ? std::min(size, file->content.size() - first) : 0;
    if (have > 0) std::memcpy(bytes, file->content.data() + first, have);
    if (have == size) return SQLITE_OK;
    std::memset(static_cast<char*>(bytes) + have, 0, size - have);
    return SQLITE_IOERR_SHORT_READ;
  }
  static int Write(sqlite3_file* handle, const void* bytes, int count, sqlite3_int64 offset) {
    Count(handle);
    File* file = Live(handle);
    if (file == nullptr) return SQLITE_IOERR_WRITE;
    SimulatedDisk& disk = *Of(handle).disk;
    const auto end = static_cast<std::size_t>(offset) + static_cast<std::size_t>(count);
    const std::size_t longer = end > file->content.size() ? end - file->content.size() : 0;
    std::string written(static_cast<const char*>(bytes), static_cast<std::size_t>(count));
    const bool is_failing = disk.IsFailing(file->path);
    if (is_failing) written.resize(disk.rng_() % (written.size() + 1));
    if (longer > 0 && disk.RoomFor(file->path).value_or(longer) < longer) return SQLITE_FULL;
    if (!written.empty()) file->Write(static_cast<std::size_t>(offset), std::move(written));
    return is_failing ? SQLITE_IOERR_WRITE : SQLITE_OK;
  }
  static int Truncate(sqlite3_file* handle, sqlite3_int64 size) {
    Count(handle);
    File* file = Live(handle);
    if (file == nullptr || Of(handle).disk->IsFailing(file->path)) return SQLITE_IOERR_TRUNCATE;
    file->Truncate(static_cast<std::size_t>(size));
    return SQLITE_OK;
  }
  static int Sync(sqlite3_file* handle, int) {
    Count(handle);
    File* file = Live(handle);
    if (file == nullptr || Of(handle).disk->IsFailing(file->path)) return SQLITE_IOERR_FSYNC;
    ++Of(handle).disk->sync_count_;
    file->unsynced.clear();
    return SQLITE_OK;
  }
  static int FileSize(sqlite3_file* handle, sqlite3_int64* size) {
    const File* file = Live(handle);
    if (file == nullptr) return SQLITE_IOERR_FSTAT;
    *size = static_cast<sqlite3_int64>(file->content.size());
    return SQLITE_OK;
  }
  static int Lock(sqlite3_file*, int) { return SQLITE_OK; }  // No locks are needed: the database has one connection.
  static int CheckReservedLock(sqlite3_file*, int* is_locked) {
    *is_locked = 0;
    return SQLITE_OK;
  }
  static int FileControl(sqlite3_file* handle, int control, void* argument) {
    const File* file = Live(handle);
    if (control != kDiskSpaceControl || file == nullptr) return SQLITE_NOTFOUND;
    auto& space = *static_cast<DiskSpace*>(argument);
    space.capacity_bytes = kCapacityBytes;
    space.free_bytes = Of(handle).disk->RoomFor(file->path).value_or(kCapacityBytes);
    return SQLITE_OK;
  }
  static int SectorSize(sqlite3_file*) { return kSectorBytes; }
  static int DeviceCharacteristics(sqlite3_file*) { return 0; }

  // Methods of the file system (sqlite3_vfs).
  static int Open(sqlite3_vfs* vfs, const char* path, sqlite3_file* handle, int flags, int* flags_out) {
    static const sqlite3_io_methods kMethods = {1,
                                                Close,
                                                Read,
                                                Write,
                                                Truncate,
                                                Sync,
                                                FileSize,
                                                Lock,
                                                Lock,
                                                CheckReservedLock,
                                                FileControl,
                                                SectorSize,
                                                DeviceCharacteristics,
                                                nullptr,
                                                nullptr,
                                                nullptr,
                                                nullptr,
                                                nullptr,
                                                nullptr};
    SimulatedDisk& disk = DiskOf(vfs);
    handle->pMethods = nullptr;
    const std::string name = path == nullptr ? "temporary" + std::to_string(disk.files_.size()) : path;
    std::shared_ptr<File> file = disk.Find(name);
    if (file == nullptr) {
      if ((flags & SQLITE_OPEN_CREATE) == 0) return SQLITE_CANTOPEN;
      file = std::make_shared<File>();
      file->path = name;
      disk.files_[name] = file;
    }
    OpenFile& open = Of(handle);
    open.disk = &disk;
    open.generation = file->generation;
    open.file = new std::shared_ptr<File>(std::move(file));
    handle->pMethods = &kMethods;
    if (flags_out != nullptr) *flags_out = flags;
    return SQLITE_OK;
  }
  static int Delete(sqlite3_vfs* vfs, const char* path, int) {
    SimulatedDisk& disk = DiskOf(vfs);
    const auto file = disk.files_.find(path);
    if (file == disk.files_.end()) return SQLITE_IOERR_DELETE_NOENT;
    if (disk.IsFailing(path)) return SQLITE_IOERR_DELETE;
    disk.files_.erase(file);
    return SQLITE_OK;
  }
  static int Access(sqlite3_vfs* vfs, const char* path, int, int* is_there) {
    *is_there = DiskOf(vfs).files_.contains(path) ? 1 : 0;
    return SQLITE_OK;
  }
  static int FullPathname(sqlite3_vfs*, const char* path, int size, char* full) {
    sqlite3_snprintf(size, full, "%s", path);
    return SQLITE_OK;
  }
  static int Randomness(sqlite3_vfs* vfs, int count, char* bytes) {
    for (int i = 0; i < count; ++i) bytes[i] = static_cast<char>(DiskOf(vfs).rng_());
    return count;
  }
  static int Sleep(sqlite3_vfs*, int microseconds) { return microseconds; }
  static int CurrentTime(sqlite3_vfs*, double* days) {
    *days = kJulianDay2026;
    return SQLITE_OK;
  }
  static int GetLastError(sqlite3_vfs*, int, char*) { return 0; }

  static void Count(sqlite3_file* handle) {
    if (Live(handle) != nullptr) Of(handle).disk->CountCall((*Of(handle).file)->path);
  }
};

SimulatedDisk::SimulatedDisk(std::uint64_t seed)
    : name_("moondb-simulated-disk-" + std::to_string(++disk_count)), rng_(seed), vfs_(std::make_unique<Vfs>()) {
  sqlite3_vfs& vfs = vfs_->vfs;
  vfs.iVersion = 1;
  vfs.szOsFile = sizeof(DiskCalls::OpenFile);
  vfs.mxPathname = 512;
  vfs.zName = name_.c_str();
  vfs.pAppData = this;
  vfs.xOpen = DiskCalls::Open;
  vfs.xDelete = DiskCalls::Delete;
  vfs.xAccess = DiskCalls::Access;
  vfs.xFullPathname = DiskCalls::FullPathname;
  vfs.xRandomness = DiskCalls::Randomness;
  vfs.xSleep = DiskCalls::Sleep;
  vfs.xCurrentTime = DiskCalls::CurrentTime;
  vfs.xGetLastError = DiskCalls::GetLastError;
  Check(sqlite3_vfs_register(&vfs, /*makeDflt=*/0) == SQLITE_OK, "SQLite takes another file system");
}

SimulatedDisk::~SimulatedDisk() { sqlite3_vfs_unregister(&vfs_->vfs); }

std::shared_ptr<SimulatedDisk::File> SimulatedDisk::Find(const std::string& path) const {
  const auto found = files_.find(path);
  return found == files_.end() ? nullptr : found->second;
}

void SimulatedDisk::CountCall(const std::string& path) {
  for (auto& [prefix, left] : calls_left_) {
    if (left > 0 && path.starts_with(prefix) && --left == 0) return CutPower(prefix);
  }
}

void SimulatedDisk::SetRoom(const std::string& prefix, std::optional<std::uint64_t> room) {
  bytes_max_.erase(prefix);
  if (room) bytes_max_[prefix] = bytes(prefix) + *room;
}

void SimulatedDisk::SetFailing(const std::string& prefix, bool is_failing) {
  failing_.erase(prefix);
  if (is_failing) failing_.insert(prefix);
}

bool SimulatedDisk::IsInTrouble(const std::string& prefix) const {
  return bytes_max_.contains(prefix) || failing_.contains(prefix);
}

bool SimulatedDisk::IsFailing(const std::string& path) const {
  return std::any_of(failing_.begin(), failing_.end(),
                     [&path](const std::string& prefix) { return path.starts_with(prefix); });
}

std::optional<std::uint64_t> SimulatedDisk::RoomFor(const std::string& path) const {
  for (const auto& [prefix, bytes_max] : bytes_max_) {
    if (!path.starts_with(prefix)) continue;
    const std::uint64_t used = bytes(prefix);
    return bytes_max > used ? bytes_max - used : 0;
  }
  return std::nullopt;
}

void SimulatedDisk::CutPowerAfter(const std::string& prefix, int calls) { calls_left_[prefix] = calls; }

void SimulatedDisk::CutPower(const std::string& prefix) {
  for (auto& [path, file] : files_) {
    if (!path.starts_with(prefix)) continue;
    ++file->generation;
    const std::vector<File::Change> unsynced = std::move(file->unsynced);
    file->unsynced.clear();
    File kept;
    kept.content = [&] {
      File before = *file;
      before.unsynced = unsynced;
      return before.Synced();
    }();
    const std::uint64_t how = rng_() % 3;
    const std::size_t first_lost = how == 1 ? rng_() % (unsynced.size() + 1) : unsynced.size();
    for (std::size_t i = 0; how != 0 && i < first_lost; ++i) {
      if (how == 2 && rng_() % 2 == 0) continue;
      File::Change change = unsynced[i];
      if (i + 1 == unsynced.size() && !change.now.empty()) {
        change.now.resize(
            std::min(change.now.size(), kSectorBytes * (rng_() % (change.now.size() / kSectorBytes + 2))));
      }
      kept.Apply(change);
    }
    file->content = std::move(kept.content);
  }
  if (on_cut) on_cut(prefix);
}

void SimulatedDisk::Wipe(const std::string& prefix) {
  std::erase_if(files_, [&](const auto& entry) { return entry.first.starts_with(prefix); });
}

SimulatedDisk::Image SimulatedDisk::Save(const std::string& prefix) const {
  Image image;
  for (const auto& [path, file] : files_) {
    if (path.starts_with(prefix)) image[path] = file->Synced();
  }
  return image;
}

void SimulatedDisk::Restore(const std::string& prefix, const Image& image) {
  Wipe(prefix);
  for (const auto& [path, content] : image) {
    auto file = std::make_shared<File>();
    file->path = path;
    file->content = content;
    files_[path] = std::move(file);
  }
}

void SimulatedDisk::Damage(const std::string& prefix) {
  File* largest = nullptr;
  for (const auto& [path, file] : files_) {
    if (!path.starts_with(prefix)) continue;
    if (largest == nullptr || file->content.size() > largest->content.size()) largest = file.get();
  }
  if (largest == nullptr || largest->content.empty()) return;
  for (int i = 0; i < 64; ++i) largest->content[rng_() % largest->content.size()] = static_cast<char>(rng_());
}

std::uint64_t SimulatedDisk::bytes(const std::string& prefix) const {
  std::uint64_t sum = 0;
  for (const auto& [path, file] : files_) sum += path.starts_with(prefix) ? file->content.size() : 0;
  return sum;
}

}  // namespace moondb::simulation
