// Contenders measured in turn within one run (A B C, A B C, ...), so that whatever else the machine does meets all of
// them alike; what counts is the median of each and the ratio of two.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "model/error.h"

namespace moondb {

using BenchClock = std::chrono::steady_clock;

// Runs one repetition with so many messages (hops, round trips) and returns its figure in the section's unit.
using Measure = std::function<Result<double>(std::uint64_t count)>;

struct Contender {
  std::string name;
  Measure measure;
};

struct Figure {
  std::string name;
  std::vector<double> samples;  // In the order in which they were measured; at least one.

  double median() const;
};

// One line of the report: one case, or one number of a case that has several.
struct Section {
  std::string name;  // Its key in the JSON report.
  std::string unit;
  std::string target;           // What moondb is to reach; empty: nothing in particular.
  std::vector<Figure> figures;  // moondb's first.
};

// Measures all contenders `repetitions` times. The first error ends it.
Result<std::vector<Figure>> MeasureInTurn(const std::vector<Contender>& contenders, int repetitions,
                                          std::uint64_t count);

double PerSecond(std::uint64_t count, BenchClock::duration took);
double MicrosecondsEach(std::uint64_t count, BenchClock::duration took);

// Runs `send(sender)` on a thread of its own for each sender, and waits for all to end.
void RunSenders(int sender_count, const std::function<void(int sender)>& send);

}  // namespace moondb
