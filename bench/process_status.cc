#include "bench/process_status.h"

#include <unistd.h>

#include <ctime>
#include <filesystem>
#include <fstream>
#include <string>

#include "model/check.h"

namespace moondb {
namespace {

// Returns the number after "NAME:" in a file of /proc. Returns 0 if there is none, for example because the thread has
// ended.
std::int64_t ReadStatus(const std::filesystem::path& path, const std::string& name) {
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with(name + ":")) return std::stoll(line.substr(name.size() + 1));
  }
  return 0;
}

}  // namespace

std::int64_t ResidentBytes() {
  std::ifstream file("/proc/self/statm");
  std::int64_t size_pages = 0;
  std::int64_t resident_pages = 0;
  Check(static_cast<bool>(file >> size_pages >> resident_pages), "the kernel reports a process's size");
  return resident_pages * ::sysconf(_SC_PAGESIZE);
}

std::int64_t PeakResidentBytes() { return ReadStatus("/proc/self/status", "VmHWM") * 1024; }

void ResetPeakResident() {
  std::ofstream file("/proc/self/clear_refs");
  Check(static_cast<bool>(file << "5" << std::flush), "a process may reset its peak");
}

std::int64_t VoluntarySwitches() {
  std::int64_t switches = 0;
  for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
    switches += ReadStatus(task.path() / "status", "voluntary_ctxt_switches");
  }
  return switches;
}

double CpuSeconds() {
  timespec time{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_nsec) * 1e-9;
}

}  // namespace moondb
