// A library for LD_PRELOAD that simulates a failing disk in tests with real processes. While the file named by
// MOONDB_FAILING_DISK exists, each write to a store, its log, its index or its reserve fails with an I/O error. Reads
// succeed.
#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include <dlfcn.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

namespace {

bool Fails(int file) {
  const char* flag = getenv("MOONDB_FAILING_DISK");
  if (flag == nullptr || access(flag, F_OK) != 0) return false;
  char link[64];
  char path[4096] = {};
  snprintf(link, sizeof link, "/proc/self/fd/%d", file);
  return readlink(link, path, sizeof path - 1) > 0 && strstr(path, "/moondb.") != nullptr;
}

template <typename Function, typename... Arguments>
auto Call(const char* name, int file, Arguments... arguments) -> decltype(Function()(file, arguments...)) {
  if (Fails(file)) {
    errno = EIO;
    return -1;
  }
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name))(file, arguments...);
}

}  // namespace

extern "C" {
ssize_t write(int file, const void* bytes, size_t count) {
  return Call<ssize_t (*)(int, const void*, size_t)>("write", file, bytes, count);
}
ssize_t pwrite(int file, const void* bytes, size_t count, off_t offset) {
  return Call<ssize_t (*)(int, const void*, size_t, off_t)>("pwrite", file, bytes, count, offset);
}
ssize_t pwrite64(int file, const void* bytes, size_t count, off64_t offset) {
  return Call<ssize_t (*)(int, const void*, size_t, off64_t)>("pwrite64", file, bytes, count, offset);
}
int ftruncate(int file, off_t size) noexcept { return Call<int (*)(int, off_t)>("ftruncate", file, size); }
int ftruncate64(int file, off64_t size) noexcept { return Call<int (*)(int, off64_t)>("ftruncate64", file, size); }
int fsync(int file) { return Call<int (*)(int)>("fsync", file); }
int fdatasync(int file) { return Call<int (*)(int)>("fdatasync", file); }
}
