// Contenders measured in turn within one run (A B C, A B C, ...), so that whatever else the machine does meets all of
// them alike; what counts is the median of each and the ratio of two.
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

// Runs one repetition with so many messages (hops, round trips) and returns its figure in the contest's unit.
using Measure = std::function<Result<double>(std::uint64_t count)>;

struct Contender {
  std::string name;
  Measure measure;  // Empty: not in this build.
};

struct Contest {
  std::string name;
  std::string unit;
  std::string target;
  std::uint64_t share;  // One repetition has one in so many of BenchOptions::messages.
  std::vector<Contender> contenders;
};

double Median(std::vector<double> samples);

struct Figure {
  std::string name;
  std::vector<double> samples;  // In the order in which they were measured; at least one.
  // Nanoseconds of all threads together on a processor, for one message; with what it takes to start and stop. Empty
  // where nothing is counted.
  std::vector<double> cpu_ns = {};

  double median() const { return Median(samples); }
};

// One number of the report, of each contender.
struct Section {
  std::string name;  // Its key in the JSON report.
  std::string unit;
  std::string target;           // What moondb is to reach; empty: nothing in particular.
  std::vector<Figure> figures;  // moondb's first.
};

// The contenders that are in this build and that the options ask for, in turn, as often as the options say. The first
// error ends it.
Result<Section> Measured(const Contest& contest, const BenchOptions& options);

bool IsAskedFor(const std::string& contender, const BenchOptions& options);

double PerSecond(std::uint64_t count, BenchClock::duration took);
double MicrosecondsEach(std::uint64_t count, BenchClock::duration took);

// Runs `send(sender)` on a thread of its own for each sender, and waits for all to end.
void RunSenders(int sender_count, const std::function<void(int sender)>& send);

}  // namespace moondb
