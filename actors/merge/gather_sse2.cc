// SSE2 kernel, for every x86-64 processor: computes the coordinates of four cells at a time and looks up the cells one
// by one.
#include "actors/merge/gather_loop.h"

#ifdef __SSE2__
#include <emmintrin.h>

namespace moondb {
namespace {

class Sse2View {
 public:
  explicit Sse2View(const KernelBlock& block, const SquareReach& reach)
      : block_(block),
        is_small_(HasSmallSteps(reach)),
        sign_(_mm_set1_epi32(INT32_MIN)),
        width_(_mm_set1_epi32(static_cast<int>(static_cast<std::uint32_t>(block.width_q) ^ 0x80000000u))),
        height_(_mm_set1_epi32(static_cast<int>(static_cast<std::uint32_t>(block.height_q) ^ 0x80000000u))),
        strip_words_(_mm_set1_epi16(static_cast<short>(block.strip_words))),
        along_u_(Ramp(block.step_cos)),
        along_v_(Ramp(-block.step_sin)) {}

  static std::uint64_t Touched(const KernelBlock& block, const SquareReach& reach) {
    return TouchedOneByOne(block, reach);
  }

  Seen See(std::int64_t u, std::int64_t v, std::uint64_t wanted) const {
    if (!is_small_) return ObserveOneByOne(block_, u, v, wanted);
    Seen seen;
    for (int four = 0; four < 16; ++four) {
      const int at = four * 4;
      if ((wanted >> at & 15) == 0) continue;
      const int x = (four & 1) * 4;
      const int y = four >> 1;
      See4(u + x * block_.step_cos + y * block_.step_sin, v - x * block_.step_sin + y * block_.step_cos, at, seen);
    }
    return seen;
  }

  static void StoreWinners(std::uint16_t* winners, std::uint64_t taken, std::uint16_t winner) {
    StoreWinnersOneByOne(winners, taken, winner);
  }

 private:
  static __m128i Ramp(std::int64_t step) {
    return _mm_set_epi32(static_cast<int>(3 * step), static_cast<int>(2 * step), static_cast<int>(step), 0);
  }

  void See4(std::int64_t first_u, std::int64_t first_v, int at, Seen& seen) const {
    const __m128i u = _mm_add_epi32(_mm_set1_epi32(static_cast<int>(first_u)), along_u_);
    const __m128i v = _mm_add_epi32(_mm_set1_epi32(static_cast<int>(first_v)), along_v_);
    const __m128i inside = _mm_and_si128(_mm_cmplt_epi32(_mm_xor_si128(u, sign_), width_),
                                         _mm_cmplt_epi32(_mm_xor_si128(v, sign_), height_));
    const auto inside_bits = static_cast<std::uint64_t>(_mm_movemask_ps(_mm_castsi128_ps(inside)));
    if (inside_bits == 0) return;
    if (block_.words == nullptr) {
      seen.known |= inside_bits << at;
      return;
    }
    const __m128i column = _mm_srli_epi32(u, kFraction);
    // A block has at most 32 strips of 512 words, so 16 bits suffice for the index. Cells outside the block read word
    // 0.
    const __m128i strip_start = _mm_mullo_epi16(_mm_srli_epi32(column, 4), strip_words_);
    const __m128i index = _mm_and_si128(_mm_add_epi32(strip_start, _mm_srli_epi32(v, kFraction)), inside);
    const __m128i shift = _mm_slli_epi32(_mm_and_si128(column, _mm_set1_epi32(15)), 1);
    const std::uint64_t cell0 = block_.words[_mm_extract_epi16(index, 0)] >> _mm_extract_epi16(shift, 0) & 3;
    const std::uint64_t cell1 = block_.words[_mm_extract_epi16(index, 2)] >> _mm_extract_epi16(shift, 2) & 3;
    const std::uint64_t cell2 = block_.words[_mm_extract_epi16(index, 4)] >> _mm_extract_epi16(shift, 4) & 3;
    const std::uint64_t cell3 = block_.words[_mm_extract_epi16(index, 6)] >> _mm_extract_epi16(shift, 6) & 3;
    // Values are 1 (free) and 2 (hazard). A cell is known if either bit is set.
    const std::uint64_t free = (cell0 & 1) | (cell1 & 1) << 1 | (cell2 & 1) << 2 | (cell3 & 1) << 3;
    const std::uint64_t hazard = cell0 >> 1 | (cell1 & 2) | (cell2 & 2) << 1 | (cell3 & 2) << 2;
    seen.known |= (inside_bits & (free | hazard)) << at;
    seen.hazard |= (inside_bits & hazard) << at;
  }

  const KernelBlock& block_;
  const bool is_small_;
  const __m128i sign_;
  const __m128i width_;
  const __m128i height_;
  const __m128i strip_words_;
  const __m128i along_u_;
  const __m128i along_v_;
};

constexpr GatherKernel kKernel{"sse2", GatherInto<Sse2View>, WouldWin<Sse2View>, SquaresThatMayKnow<Sse2View>};

}  // namespace

const GatherKernel* Sse2Kernel() { return &kKernel; }

}  // namespace moondb
#else
namespace moondb {
const GatherKernel* Sse2Kernel() { return nullptr; }
}  // namespace moondb
#endif
