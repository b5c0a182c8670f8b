// Statistics of the kernel about this process.
#pragma once

#include <cstdint>

namespace moondb {

// Return the resident memory of this process in bytes. ResidentBytes: at present (/proc/self/statm). PeakResidentBytes:
// the peak since ResetPeakResident (/proc/self/status, VmHWM).
std::int64_t ResidentBytes();
std::int64_t PeakResidentBytes();
void ResetPeakResident();

// Returns how often the present threads gave up their processor in order to wait: their voluntary context switches
// (/proc/self/task/*/status).
std::int64_t VoluntarySwitches();

// Returns the processor time of all threads in seconds.
double CpuSeconds();

}  // namespace moondb
