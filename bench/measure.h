// Measures contenders in turn within one run (A B C, A B C, ...). Other load on the machine then affects all of them
// equally. The result is the median of each contender and the ratio of two medians.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "bench/options.h"
#include "model/error.h"

namespace moondb {

using BenchClock = std::chrono::steady_clock;

// Runs one repetition with `count` messages (hops, round trips) and returns its figure in the contest's unit.
using Measure = std::function<Result<double>(std::uint64_t count)>;

struct Contender {
  std::string name;
  Measure measure;  // Empty if this build does not have the contender.
};

struct Contest {
  std::string name;
  std::string unit;
  std::string target;
  std::uint64_t share;  // Divisor: a repetition has BenchOptions::messages / share.
  std::vector<Contender> contenders;
};

double Median(std::vector<double> samples);

struct Figure {
  std::string name;
  std::vector<double> samples;  // At least one, in the order of measurement.
  // Processor time per message in nanoseconds, summed over all threads, with start and stop. Empty if this case does
  // not measure processor time.
  std::vector<double> cpu_ns = {};

  double median() const { return Median(samples); }
};

// One number of the report, measured for each contender.
struct Section {
  std::string name;  // Its key in the JSON report.
  std::string unit;
  std::string target;           // Goal for moondb; empty if it has none.
  std::vector<Figure> figures;  // The figure of moondb is first.
};

// Measures in turn the contenders that are in this build and that the options select, as often as the options say.
// Returns the first error.
Result<Section> Measured(const Contest& contest, const BenchOptions& options);

bool IsAskedFor(const std::string& contender, const BenchOptions& options);

double PerSecond(std::uint64_t count, BenchClock::duration took);
double MicrosecondsEach(std::uint64_t count, BenchClock::duration took);

// Runs `send(sender)` on one thread for each sender, and waits for all of them.
void RunSenders(int sender_count, const std::function<void(int sender)>& send);

}  // namespace moondb
