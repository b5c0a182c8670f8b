#pragma once

#include <cstdint>

namespace moondb {

// ResidentBytes returns the present resident memory of this process (/proc/self/statm). PeakResidentBytes returns its
// peak since ResetPeakResident (/proc/self/status, VmHWM). Both are in bytes.
std::int64_t ResidentBytes();
std::int64_t PeakResidentBytes();
void ResetPeakResident();

// Returns the number of voluntary context switches of all running threads: how often a thread has waited
// (/proc/self/task/*/status).
std::int64_t VoluntarySwitches();

// Returns the processor time of this process in seconds, summed over all threads.
double CpuSeconds();

}  // namespace moondb
