// The same cases as moondb_cases.h with the C++ Actor Framework, as its manual shows them. A small message is one
// uint64_t.
#pragma once

#include <cstdint>

#include "model/error.h"

namespace moondb {

Result<double> CafFanIn(int sender_count, std::uint64_t count);
Result<double> CafActorToActor(std::uint64_t count);
Result<double> CafPingPongSameWorker(std::uint64_t count);
Result<double> CafPingPongAcrossThreads(std::uint64_t count);
Result<double> CafRing(std::uint64_t count);

}  // namespace moondb
