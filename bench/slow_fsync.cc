// A library for LD_PRELOAD that makes each fsync and fdatasync MOONDB_FSYNC_MS milliseconds slower, like the memory
// card of a small computer. wait_trials.py builds and uses it.
#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include <dlfcn.h>
#include <stdlib.h>
#include <unistd.h>

namespace {

int Slowly(const char* name, int file) {
  const char* milliseconds = getenv("MOONDB_FSYNC_MS");
  if (milliseconds != nullptr) usleep(static_cast<useconds_t>(atoi(milliseconds)) * 1000);
  return reinterpret_cast<int (*)(int)>(dlsym(RTLD_NEXT, name))(file);
}

}  // namespace

extern "C" {
int fsync(int file) { return Slowly("fsync", file); }
int fdatasync(int file) { return Slowly("fdatasync", file); }
}
