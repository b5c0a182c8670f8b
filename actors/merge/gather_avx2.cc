// AVX2 kernel: processes eight cells at a time with gather instructions.
#include "actors/merge/gather_loop.h"

#ifdef __AVX2__
#include <immintrin.h>

namespace moondb {
namespace {

class Avx2View {
 public:
  explicit Avx2View(const KernelBlock& block, const SquareReach& reach)
      : block_(block),
        is_small_(HasSmallSteps(reach)),
        width_(_mm256_set1_epi32(static_cast<int>(static_cast<std::uint32_t>(block.width_q) - 1))),
        height_(_mm256_set1_epi32(static_cast<int>(static_cast<std::uint32_t>(block.height_q) - 1))),
        strip_words_(_mm256_set1_epi32(block.strip_words)),
        along_u_(Ramp(block.step_cos)),
        along_v_(Ramp(-block.step_sin)) {}

  static std::uint64_t Touched(const KernelBlock& block, const SquareReach& reach) {
    const __m256i ramp_u = WideRamp(8 * block.step_cos);
    const __m256i ramp_v = WideRamp(-8 * block.step_sin);
    const __m256i u_above = _mm256_set1_epi64x(-reach.u_high - 1);
    const __m256i u_below = _mm256_set1_epi64x(block.width_q - reach.u_low);
    const __m256i v_above = _mm256_set1_epi64x(-reach.v_high - 1);
    const __m256i v_below = _mm256_set1_epi64x(block.height_q - reach.v_low);
    std::uint64_t touched = 0;
    for (int four = 0; four < 16; ++four) {
      const std::int64_t x = (four & 1) * 4;
      const std::int64_t y = four >> 1;
      const __m256i u =
          _mm256_add_epi64(_mm256_set1_epi64x(block.u + 8 * (x * block.step_cos + y * block.step_sin)), ramp_u);
      const __m256i v =
          _mm256_add_epi64(_mm256_set1_epi64x(block.v + 8 * (y * block.step_cos - x * block.step_sin)), ramp_v);
      const __m256i meets =
          _mm256_and_si256(_mm256_and_si256(_mm256_cmpgt_epi64(u, u_above), _mm256_cmpgt_epi64(u_below, u)),
                           _mm256_and_si256(_mm256_cmpgt_epi64(v, v_above), _mm256_cmpgt_epi64(v_below, v)));
      touched |= static_cast<std::uint64_t>(_mm256_movemask_pd(_mm256_castsi256_pd(meets))) << (four * 4);
    }
    return touched;
  }

  Seen See(std::int64_t u, std::int64_t v, std::uint64_t wanted) const {
    if (!is_small_) return ObserveOneByOne(block_, u, v, wanted);
    Seen seen;
    for (int y = 0; y < 8; ++y) {
      if ((wanted >> (y * 8) & 255) == 0) continue;
      See8(u + y * block_.step_sin, v + y * block_.step_cos, y * 8, seen);
    }
    return seen;
  }

  static void StoreWinners(std::uint16_t* winners, std::uint64_t taken, std::uint16_t winner) {
    const __m256i bits =
        _mm256_setr_epi16(1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, -32768);
    const __m256i value = _mm256_set1_epi16(static_cast<short>(winner));
    for (int i = 0; i < 4; ++i, taken >>= 16, winners += 16) {
      const __m256i of_lane = _mm256_and_si256(_mm256_set1_epi16(static_cast<short>(taken)), bits);
      const __m256i chosen = _mm256_cmpeq_epi16(of_lane, bits);
      auto* at = reinterpret_cast<__m256i*>(winners);
      _mm256_storeu_si256(at, _mm256_blendv_epi8(_mm256_loadu_si256(at), value, chosen));
    }
  }

 private:
  static __m256i Ramp(std::int64_t step) {
    return _mm256_mullo_epi32(_mm256_set1_epi32(static_cast<int>(step)), _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
  }
  static __m256i WideRamp(std::int64_t step) { return _mm256_setr_epi64x(0, step, 2 * step, 3 * step); }

  void See8(std::int64_t first_u, std::int64_t first_v, int at, Seen& seen) const {
    const __m256i u = _mm256_add_epi32(_mm256_set1_epi32(static_cast<int>(first_u)), along_u_);
    const __m256i v = _mm256_add_epi32(_mm256_set1_epi32(static_cast<int>(first_v)), along_v_);
    const __m256i inside = _mm256_and_si256(_mm256_cmpeq_epi32(_mm256_min_epu32(u, width_), u),
                                            _mm256_cmpeq_epi32(_mm256_min_epu32(v, height_), v));
    const auto inside_bits = static_cast<std::uint32_t>(_mm256_movemask_ps(_mm256_castsi256_ps(inside)));
    if (inside_bits == 0) return;
    if (block_.words == nullptr) {
      seen.known |= static_cast<std::uint64_t>(inside_bits) << at;
      return;
    }
    const __m256i column = _mm256_srli_epi32(u, kFraction);
    const __m256i strip_start = _mm256_mullo_epi16(_mm256_srli_epi32(column, 4), strip_words_);
    const __m256i index = _mm256_add_epi32(strip_start, _mm256_srli_epi32(v, kFraction));
    const __m256i word = _mm256_mask_i32gather_epi32(_mm256_setzero_si256(), reinterpret_cast<const int*>(block_.words),
                                                     index, inside, 4);
    // Shift the two bits of each cell to the top of its lane. The sign bit is then the hazard bit. After doubling, the
    // sign bit is the free bit.
    const __m256i shift =
        _mm256_sub_epi32(_mm256_set1_epi32(30), _mm256_slli_epi32(_mm256_and_si256(column, _mm256_set1_epi32(15)), 1));
    const __m256i cell = _mm256_sllv_epi32(word, shift);
    const auto hazard = static_cast<std::uint32_t>(_mm256_movemask_ps(_mm256_castsi256_ps(cell)));
    const auto free = static_cast<std::uint32_t>(_mm256_movemask_ps(_mm256_castsi256_ps(_mm256_add_epi32(cell, cell))));
    seen.known |= static_cast<std::uint64_t>(hazard | free) << at;
    seen.hazard |= static_cast<std::uint64_t>(hazard) << at;
  }

  const KernelBlock& block_;
  const bool is_small_;
  const __m256i width_;
  const __m256i height_;
  const __m256i strip_words_;
  const __m256i along_u_;
  const __m256i along_v_;
};

constexpr GatherKernel kKernel{"avx2", GatherInto<Avx2View>, WouldWin<Avx2View>, SquaresThatMayKnow<Avx2View>};

}  // namespace

const GatherKernel* Avx2Kernel() { return &kKernel; }

}  // namespace moondb
#else
namespace moondb {
const GatherKernel* Avx2Kernel() { return nullptr; }
}  // namespace moondb
#endif
