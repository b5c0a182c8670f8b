// Sets the umask of a test. The destructor restores it.
#pragma once

#include <sys/stat.h>

#include <filesystem>

namespace moondb {

class ScopedUmask {
 public:
  explicit ScopedUmask(mode_t mask) : before_(::umask(mask)) {}
  ~ScopedUmask() { ::umask(before_); }
  ScopedUmask(const ScopedUmask&) = delete;
  ScopedUmask& operator=(const ScopedUmask&) = delete;

 private:
  mode_t before_;
};

// Returns the mode of a file or folder, without its type. Does not follow a link. 07777: it is missing.
inline mode_t ModeOf(const std::filesystem::path& path) {
  struct stat status {};
  return ::lstat(path.c_str(), &status) == 0 ? status.st_mode & 07777 : 07777;
}

}  // namespace moondb
