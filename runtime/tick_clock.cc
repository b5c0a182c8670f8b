#include "runtime/tick_clock.h"

#include <algorithm>

namespace moondb {
namespace {

double Measure() {
  constexpr Duration kLong = std::chrono::milliseconds(1);
  const auto start = std::chrono::steady_clock::now();
  const Ticks first = TickClock::Now();
  auto end = start;
  while (end - start < kLong) end = std::chrono::steady_clock::now();
  const Ticks ticks = std::max<Ticks>(1, TickClock::Now() - first);
  return static_cast<double>(Duration(end - start).count()) / static_cast<double>(ticks);
}

}  // namespace

double TickClock::NanosecondsPerTick() {
  static const double nanoseconds = Measure();
  return nanoseconds;
}

}  // namespace moondb
