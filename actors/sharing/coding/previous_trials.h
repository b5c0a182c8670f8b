// PreviousTrials: with which maps an encoder looks for the previous one, so that it takes no longer than it is worth.
//
// To place the previous map and to code with it and without takes three times as long as to code a map alone. Where
// maps roll over one grid it halves them, where they turn with the robot it brings 2 to 8 %. So it is tried now and
// then: after two trials in a row that brought less than kGainMin it rests for kRestMaps; after one that brought
// kGainLarge the next kTrustMaps are coded with it without comparing. Not thread-safe.
#pragma once

#include <cstddef>

namespace moondb {

class PreviousTrials {
 public:
  enum class Way { kAlone, kBoth, kWithPrevious };

  static constexpr double kGainMin = 1.0 / 8;  // Of a map's bytes.
  static constexpr double kGainLarge = 1.0 / 4;
  static constexpr int kRestMaps = 32;
  static constexpr int kTrustMaps = 7;

  // For the next map that has a previous one.
  Way next() const { return rest_ > 0 ? Way::kAlone : trust_ > 0 ? Way::kWithPrevious : Way::kBoth; }

  // It was coded both ways.
  void Compared(std::size_t bytes_alone, std::size_t bytes_with_previous) {
    const double alone = static_cast<double>(bytes_alone);
    const double gain = alone - static_cast<double>(bytes_with_previous);
    if (gain < kGainMin * alone) return Fail();
    failures_ = 0;
    if (gain >= kGainLarge * alone) trust_ = kTrustMaps;
  }

  // It was coded one way, as that way says or because the previous map could not be placed.
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
  // After a rest one failure is enough for the next.
  void Fail() {
    trust_ = 0;
    if (++failures_ < 2) return;
    failures_ = 1;
    rest_ = kRestMaps;
  }

  int rest_ = 0;      // Maps that are coded alone from here on.
  int trust_ = 0;     // Maps that are coded with the previous one.
  int failures_ = 0;  // Trials in a row.
};

}  // namespace moondb
