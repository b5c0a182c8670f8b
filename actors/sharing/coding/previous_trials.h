// PreviousTrials: decides for which maps an encoder tries prediction from the previous map, since a trial is expensive.
//
// A trial places the previous map and codes the map with and without it, which takes three times as long as coding the
// map alone. The previous map halves the bytes if maps scroll over one grid, but saves only 2 to 8 % if maps turn with
// the robot. After two trials in a row that gain less than kGainMin, the next kRestMaps maps are coded alone. After a
// trial that gains at least kGainLarge, the next kTrustMaps maps are coded with the previous map without a comparison.
// Not thread-safe.
#pragma once

#include <cstddef>

namespace moondb {

class PreviousTrials {
 public:
  enum class Way { kAlone, kBoth, kWithPrevious };

  static constexpr double kGainMin = 1.0 / 8;  // Gains are fractions of the bytes of a map that is coded alone.
  static constexpr double kGainLarge = 1.0 / 4;
  static constexpr int kRestMaps = 32;
  static constexpr int kTrustMaps = 7;

  // Returns how to code the next map that has a previous map.
  Way next() const { return rest_ > 0 ? Way::kAlone : trust_ > 0 ? Way::kWithPrevious : Way::kBoth; }

  // Call when a map was coded with and without the previous map. Pass the sizes of both results.
  void Compared(std::size_t bytes_alone, std::size_t bytes_with_previous) {
    const double alone = static_cast<double>(bytes_alone);
    const double gain = alone - static_cast<double>(bytes_with_previous);
    if (gain < kGainMin * alone) return Fail();
    failures_ = 0;
    if (gain >= kGainLarge * alone) trust_ = kTrustMaps;
  }

  // Call when a map was coded in one way only. `way` is the result of next(). `is_placed` is true if the map was coded
  // with the previous map, and false if the map was coded alone.
  void Coded(Way way, bool is_placed) {
    if (way == Way::kAlone) {
      if (rest_ > 0) --rest_;
    } else if (!is_placed) {
      Fail();
    } else if (trust_ > 0) {
      --trust_;
    }
  }

 private:
  // Counts a failed trial. After two failures in a row, the next kRestMaps maps are coded alone. After these maps, a
  // single failure has the same effect.
  void Fail() {
    trust_ = 0;
    if (++failures_ < 2) return;
    failures_ = 1;
    rest_ = kRestMaps;
  }

  int rest_ = 0;      // How many of the following maps are coded alone.
  int trust_ = 0;     // How many of the following maps are coded with the previous map, without a comparison.
  int failures_ = 0;  // Number of failed trials in a row.
};

}  // namespace moondb
