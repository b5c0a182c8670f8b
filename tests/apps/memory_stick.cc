// A library for LD_PRELOAD that simulates a memory stick with FAT in tests with real processes. There are no hard links
// and no RENAME_NOREPLACE. The folder named by MOONDB_MEMORY_STICK has the file system FAT.
#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include <dlfcn.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/statfs.h>

extern "C" {
int link(const char*, const char*) noexcept {
  errno = EPERM;
  return -1;
}
int linkat(int, const char*, int, const char*, int) noexcept {
  errno = EPERM;
  return -1;
}
int renameat2(int, const char*, int, const char*, unsigned int) noexcept {
  errno = EINVAL;
  return -1;
}
int statfs(const char* path, struct statfs* system) noexcept {
  const int result = reinterpret_cast<int (*)(const char*, struct statfs*)>(dlsym(RTLD_NEXT, "statfs"))(path, system);
  const char* stick = getenv("MOONDB_MEMORY_STICK");
  if (stick != nullptr && strncmp(path, stick, strlen(stick)) == 0) system->f_type = 0x4d44;
  return result;
}
}
