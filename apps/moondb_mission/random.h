// Random: a seeded random generator that gives the same numbers with every standard library.
//
// The C++ standard fixes the engine (std::mt19937_64), but not the distributions of std::, so this class implements its
// own. Not thread-safe.
#pragma once

#include <cstdint>
#include <random>

namespace moondb {

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  // Returns an independent random stream for one purpose. Each part of a mission has its own stream, so a change to one
  // part leaves the others unchanged.
  static Random Stream(std::uint64_t seed, std::uint64_t purpose);

  double Uniform();                         // Uniform in [0, 1).
  double Uniform(double low, double high);  // Uniform between low and high.
  double Normal();                          // Normal with mean 0 and sigma 1.
  double Exponential(double mean);
  int Index(int count);  // Uniform integer in 0 to count - 1.
  int Poisson(double mean);
  bool Chance(double probability) { return Uniform() < probability; }

 private:
  std::mt19937_64 engine_;
};

}  // namespace moondb
