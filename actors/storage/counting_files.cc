#include "actors/storage/counting_files.h"

#include <atomic>
#include <cstddef>

#include "model/check.h"

namespace moondb {

// The pMethods of each open file points to `methods`. Write casts this pointer to FileTail, to find the owner.
struct CountingFiles::FileTail {
  sqlite3_io_methods methods{};
  const sqlite3_io_methods* base_methods = nullptr;
  CountingFiles* owner = nullptr;
};

CountingFiles::CountingFiles(const std::string& base) {
  static std::atomic<std::uint64_t> count = 0;
  name_ = "moondb-counting-" + std::to_string(++count);
  base_ = sqlite3_vfs_find(base.empty() ? nullptr : base.c_str());
  Check(base_ != nullptr, "a file system is registered before it is used");
  vfs_.base = *base_;
  vfs_.base.pNext = nullptr;
  vfs_.base.zName = name_.c_str();
  vfs_.base.szOsFile = base_->szOsFile + static_cast<int>(sizeof(FileTail) + alignof(std::max_align_t));
  vfs_.base.xOpen = Open;
  vfs_.owner = this;
  Check(sqlite3_vfs_register(&vfs_.base, /*makeDflt=*/0) == SQLITE_OK, "a file system can be registered");
}

CountingFiles::~CountingFiles() { (void)sqlite3_vfs_unregister(&vfs_.base); }

CountingFiles::FileTail& CountingFiles::TailOf(sqlite3_file* file, int base_bytes) {
  constexpr std::size_t kAlign = alignof(std::max_align_t);
  const std::size_t at = (static_cast<std::size_t>(base_bytes) + kAlign - 1) / kAlign * kAlign;
  return *reinterpret_cast<FileTail*>(reinterpret_cast<char*>(file) + at);
}

int CountingFiles::Open(sqlite3_vfs* vfs, const char* path, sqlite3_file* file, int flags, int* flags_out) {
  CountingFiles& owner = *reinterpret_cast<Vfs*>(vfs)->owner;
  const int code = owner.base_->xOpen(owner.base_, path, file, flags, flags_out);
  if (file->pMethods == nullptr) return code;  // SQLite does not close a file that failed to open.
  FileTail& tail = TailOf(file, owner.base_->szOsFile);
  tail.methods = *file->pMethods;
  tail.methods.xWrite = Write;
  tail.base_methods = file->pMethods;
  tail.owner = &owner;
  file->pMethods = &tail.methods;
  return code;
}

int CountingFiles::Write(sqlite3_file* file, const void* bytes, int count, sqlite3_int64 offset) {
  // The cast is valid: FileTail has standard layout, and `methods` is its first member.
  const auto& tail = *reinterpret_cast<const FileTail*>(file->pMethods);
  const int code = tail.base_methods->xWrite(file, bytes, count, offset);
  if (code == SQLITE_OK) tail.owner->written_bytes_ += static_cast<std::uint64_t>(count);
  return code;
}

}  // namespace moondb
