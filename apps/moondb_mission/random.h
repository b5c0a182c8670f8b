// Random: numbers from one seed that are the same with every standard library.
//
// The engine (std::mt19937_64) is fixed by the C++ standard, the distributions of std:: are not; so they are written
// out here. Not thread-safe.
#pragma once

#include <cstdint>
#include <random>

namespace moondb {

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  // An independent stream for one purpose, so that a change to one part of a mission leaves the others as they were.
  static Random Stream(std::uint64_t seed, std::uint64_t purpose);

  double Uniform();                         // 0 to 1, without 1.
  double Uniform(double low, double high);  // low to high.
  double Normal();                          // Mean 0, sigma 1.
  double Exponential(double mean);
  int Index(int count);  // 0 to count - 1.
  int Poisson(double mean);
  bool Chance(double probability) { return Uniform() < probability; }

 private:
  std::mt19937_64 engine_;
};

}  // namespace moondb
