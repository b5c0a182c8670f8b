// Statistics of the kernel about this process.
#pragma once

#include <cstdint>

namespace moondb {

// Resident memory in bytes: the present value (/proc/self/statm), and the peak since ResetPeakResident
// (/proc/self/status, VmHWM).
std::int64_t ResidentBytes();
std::int64_t PeakResidentBytes();
void ResetPeakResident();

// Voluntary context switches of the present threads: how often they gave up their processor to wait
// (/proc/self/task/*/status).
std::int64_t VoluntarySwitches();

// Processor time of all threads in seconds.
double CpuSeconds();

}  // namespace moondb
