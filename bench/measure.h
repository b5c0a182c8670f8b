// Compares contenders (implementations of the same task). The contenders run in turn (A B C, A B C, ...), so that other
// load on the machine affects all of them equally. A result has the median of each contender, and the ratios of these
// medians.
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

// Runs one repetition with `count` messages, hops or round trips. Returns the result in the contest's unit.
using Measure = std::function<Result<double>(std::uint64_t count)>;

struct Contender {
  std::string name;
  Measure measure;  // Empty if this build does not have the contender.
};

struct Contest {
  std::string name;
  std::string unit;
  std::string target;
  std::uint64_t share;  // A repetition has BenchOptions::messages / share messages.
  std::vector<Contender> contenders;
};

double Median(std::vector<double> samples);

struct Figure {
  std::string name;
  std::vector<double> samples;  // Results of the repetitions in order; at least one.
  // Processor time per message in nanoseconds, summed over all threads, including start and stop. Empty if this case
  // does not measure processor time.
  std::vector<double> cpu_ns = {};

  double median() const { return Median(samples); }
};

// One measured quantity, with a Figure for each contender.
struct Section {
  std::string name;  // Key in the JSON report.
  std::string unit;
  std::string target;           // Goal for moondb; empty if there is none.
  std::vector<Figure> figures;  // The first figure is moondb's.
};

// Repeats the contest as often as the options request. In each repetition, every selected contender of this build runs
// once. Returns the first error.
Result<Section> Measured(const Contest& contest, const BenchOptions& options);

bool IsAskedFor(const std::string& contender, const BenchOptions& options);

double PerSecond(std::uint64_t count, BenchClock::duration took);
double MicrosecondsEach(std::uint64_t count, BenchClock::duration took);

// Runs `send(sender)` on one thread for each sender, and waits for all of them.
void RunSenders(int sender_count, const std::function<void(int sender)>& send);

}  // namespace moondb
