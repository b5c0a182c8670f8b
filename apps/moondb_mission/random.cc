#include "apps/moondb_mission/random.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace moondb {

namespace {

// The finaliser of SplitMix64. Neighbouring inputs give unrelated seeds.
std::uint64_t Mix(std::uint64_t value) {
  value = (value ^ (value >> 30)) * 0xbf58476d1ce4e5b9u;
  value = (value ^ (value >> 27)) * 0x94d049bb133111ebu;
  return value ^ (value >> 31);
}

}  // namespace

Random Random::Stream(std::uint64_t seed, std::uint64_t purpose) {
  return Random(Mix(Mix(seed + 0x9e3779b97f4a7c15u) + purpose));
}

double Random::Uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }

double Random::Uniform(double low, double high) { return low + (high - low) * Uniform(); }

double Random::Normal() {
  // The Box-Muller transform. 1 - Uniform() is never 0.
  const double radius = std::sqrt(-2 * std::log(1 - Uniform()));
  return radius * std::cos(2 * std::numbers::pi * Uniform());
}

double Random::Exponential(double mean) { return -mean * std::log(1 - Uniform()); }

int Random::Index(int count) { return std::min(count - 1, static_cast<int>(Uniform() * count)); }

int Random::Poisson(double mean) {
  // Knuth's algorithm multiplies uniform numbers, and the product underflows for large means. Split the mean: a sum of
  // Poisson numbers is a Poisson number.
  constexpr double kPartMax = 30;
  int count = 0;
  while (mean > 0) {
    const double part = std::min(mean, kPartMax);
    mean -= part;
    const double end = std::exp(-part);
    for (double product = Uniform(); product > end; product *= Uniform()) ++count;
  }
  return count;
}

}  // namespace moondb
