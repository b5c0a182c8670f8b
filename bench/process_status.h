// What the kernel knows of this process.
#pragma once

#include <cstdint>

namespace moondb {

// In bytes: now (/proc/self/statm), and the most since ResetPeakResident (/proc/self/status, VmHWM).
std::int64_t ResidentBytes();
std::int64_t PeakResidentBytes();
void ResetPeakResident();

// Times that a thread that still lives gave up its processor to wait (/proc/self/task/*/status).
std::int64_t VoluntarySwitches();

// All threads' time on a processor.
double CpuSeconds();

}  // namespace moondb
