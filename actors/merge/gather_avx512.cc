// AVX-512 kernel (with VBMI: Ice Lake, Zen 4 and later): looks up 64 cells at a time.
//
// If the cells of the merged map are at most about as large as the layer's cells, a square of 8 x 8 cells reads at most
// 16 rows and 16 columns of the layer. These columns lie in two neighbouring strips. Each strip's 16 rows take 64 bytes
// and fit in one register. One permutation of the two registers returns the byte of each cell. A byte's index consists
// of the strip (1 bit), the row (4 bits) and the byte in the row (2 bits).
#include "actors/merge/gather_loop.h"

#if defined(__AVX512F__) && defined(__AVX512BW__) && defined(__AVX512VBMI__)
#include <immintrin.h>

namespace moondb {
namespace {

// After a left shift of u by kShiftU, the top byte is the column in units of half a column. After a left shift of v by
// kShiftV, the top byte is the row in units of a quarter row.
constexpr int kShiftU = 3;
constexpr int kShiftV = 4;

struct Tables {
  // Permutation that selects the top byte of each 32-bit lane: first 16 lanes of one register, then 16 lanes of
  // another.
  alignas(64) std::uint8_t top_bytes[64];
  // For each half column: the strip and the byte in the row, as bits of a byte index.
  alignas(64) std::uint8_t byte_of_half[64];
  alignas(64) std::uint8_t bits_of_half[64];  // For each half column: mask of the cell's two bits in its byte.
};

constexpr Tables MakeTables() {
  Tables tables{};
  for (int i = 0; i < 64; ++i) {
    const int column = i / 2;
    tables.top_bytes[i] = static_cast<std::uint8_t>(i % 32 / 16 * 64 + i % 16 * 4 + 3);
    tables.byte_of_half[i] = static_cast<std::uint8_t>(column / 16 * 64 + column % 16 / 4);
    tables.bits_of_half[i] = static_cast<std::uint8_t>(3 << (2 * (column % 4)));
  }
  return tables;
}

constexpr Tables kTables = MakeTables();

class Avx512View {
 public:
  explicit Avx512View(const KernelBlock& block, const SquareReach& reach) : block_(block), reach_(reach) {
    const bool is_narrow = reach_.u_high - reach_.u_low <= 15 * kCell;
    way_ = is_narrow && block.words != nullptr ? Way::kWindow : HasSmallSteps(reach_) ? Way::kGather : Way::kOneByOne;
    if (way_ == Way::kOneByOne) return;
    const __m512i x = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 2, 3, 4, 5, 6, 7);
    const __m512i first_y = _mm512_setr_epi32(0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1);
    const __m512i c = _mm512_set1_epi32(static_cast<int>(block.step_cos));
    const __m512i s = _mm512_set1_epi32(static_cast<int>(block.step_sin));
    const __m512i first_u = _mm512_add_epi32(_mm512_mullo_epi32(x, c), _mm512_mullo_epi32(first_y, s));
    const __m512i first_v = _mm512_sub_epi32(_mm512_mullo_epi32(first_y, c), _mm512_mullo_epi32(x, s));
    const unsigned shift_u = way_ == Way::kWindow ? kShiftU : 0;
    const unsigned shift_v = way_ == Way::kWindow ? kShiftV : 0;
    for (int i = 0; i < 4; ++i) {
      const __m512i u = _mm512_add_epi32(first_u, _mm512_set1_epi32(static_cast<int>(2 * i * block.step_sin)));
      const __m512i v = _mm512_add_epi32(first_v, _mm512_set1_epi32(static_cast<int>(2 * i * block.step_cos)));
      u_[i] = _mm512_slli_epi32(u, shift_u);
      v_[i] = _mm512_slli_epi32(v, shift_v);
    }
  }

  static std::uint64_t Touched(const KernelBlock& block, const SquareReach& reach) {
    const __m512i x = _mm512_setr_epi64(0, 8, 16, 24, 32, 40, 48, 56);
    const __m512i step_cos = _mm512_set1_epi64(block.step_cos);
    const __m512i step_sin = _mm512_set1_epi64(block.step_sin);
    // |step| < 2^31 and x < 2^6, so the signed product of the low 32 bits is exact.
    __m512i u = _mm512_add_epi64(_mm512_set1_epi64(block.u), _mm512_mul_epi32(x, step_cos));
    __m512i v = _mm512_sub_epi64(_mm512_set1_epi64(block.v), _mm512_mul_epi32(x, step_sin));
    const __m512i down_u = _mm512_slli_epi64(step_sin, 3);
    const __m512i down_v = _mm512_slli_epi64(step_cos, 3);
    const __m512i u_least = _mm512_set1_epi64(-reach.u_high);
    const __m512i u_end = _mm512_set1_epi64(block.width_q - reach.u_low);
    const __m512i v_least = _mm512_set1_epi64(-reach.v_high);
    const __m512i v_end = _mm512_set1_epi64(block.height_q - reach.v_low);
    std::uint64_t touched = 0;
    for (int y = 0; y < 8; ++y) {
      __mmask8 meets = _mm512_cmpge_epi64_mask(u, u_least);
      meets = _mm512_mask_cmplt_epi64_mask(meets, u, u_end);
      meets = _mm512_mask_cmpge_epi64_mask(meets, v, v_least);
      meets = _mm512_mask_cmplt_epi64_mask(meets, v, v_end);
      touched |= static_cast<std::uint64_t>(meets) << (y * 8);
      u = _mm512_add_epi64(u, down_u);
      v = _mm512_add_epi64(v, down_v);
    }
    return touched;
  }

  Seen See(std::int64_t u, std::int64_t v, std::uint64_t wanted) const {
    if (way_ == Way::kWindow) return ObserveWindow(u, v);
    if (way_ == Way::kGather) return ReadByGathers(u, v);
    return ObserveOneByOne(block_, u, v, wanted);
  }

  static void StoreWinners(std::uint16_t* winners, std::uint64_t taken, std::uint16_t winner) {
    const __m512i value = _mm512_set1_epi16(static_cast<short>(winner));
    _mm512_mask_storeu_epi16(winners, static_cast<__mmask32>(taken), value);
    _mm512_mask_storeu_epi16(winners + 32, static_cast<__mmask32>(taken >> 32), value);
  }

 private:
  enum class Way { kWindow, kGather, kOneByOne };

  static __m512i Load(const std::uint8_t* table) { return _mm512_load_si512(table); }

  // Returns the top bytes of the 64 sums base + offsets[0..3], in the order of the cells.
  static __m512i TopBytes(std::uint32_t base, const __m512i* offsets) {
    const __m512i start = _mm512_set1_epi32(static_cast<int>(base));
    const __m512i choice = Load(kTables.top_bytes);
    const __m512i low =
        _mm512_permutex2var_epi8(_mm512_add_epi32(start, offsets[0]), choice, _mm512_add_epi32(start, offsets[1]));
    const __m512i high =
        _mm512_permutex2var_epi8(_mm512_add_epi32(start, offsets[2]), choice, _mm512_add_epi32(start, offsets[3]));
    return _mm512_shuffle_i64x2(low, high, 0x44);
  }

  static std::int32_t AtLeast(std::int32_t a, std::int32_t least) { return a < least ? least : a; }
  static std::int32_t AtMost(std::int32_t a, std::int32_t most) { return a > most ? most : a; }

  const std::uint32_t* Strip(std::int32_t strip, std::int32_t row) const {
    // Clamp the strip so that the address is valid. Cells of a strip outside the block are not used.
    const std::int32_t there = AtMost(AtLeast(strip, 0), block_.strip_count - 1);
    return block_.words + there * block_.strip_words + row;
  }

  // Looks up the 64 cells of one square in a window of 16 rows of two neighbouring strips. Requires: the square touches
  // the block. The window then starts at most 15 rows and one strip before the block.
  Seen ObserveWindow(std::int64_t u, std::int64_t v) const {
    const auto first_column = static_cast<std::int32_t>((u + reach_.u_low) >> (kFraction + 4)) * 16;
    const auto first_row = static_cast<std::int32_t>((v + reach_.v_low) >> kFraction);
    const __m512i left = _mm512_loadu_si512(Strip(first_column >> 4, first_row));
    const __m512i right = _mm512_loadu_si512(Strip((first_column >> 4) + 1, first_row));
    const __m512i half_columns = TopBytes(static_cast<std::uint32_t>((u - first_column * kCell) << kShiftU), u_);
    const __m512i quarter_rows = TopBytes(static_cast<std::uint32_t>((v - first_row * kCell) << kShiftV), v_);

    const std::int32_t column_begin = AtLeast(-first_column, 0);
    const std::int32_t column_end = AtMost(static_cast<std::int32_t>(block_.width_q >> kFraction) - first_column, 32);
    const std::int32_t row_begin = AtLeast(-first_row, 0);
    const std::int32_t row_end = AtMost(static_cast<std::int32_t>(block_.height_q >> kFraction) - first_row, 16);
    const __mmask64 inside_columns =
        _mm512_cmplt_epu8_mask(_mm512_sub_epi8(half_columns, _mm512_set1_epi8(static_cast<char>(2 * column_begin))),
                               _mm512_set1_epi8(static_cast<char>(2 * (column_end - column_begin))));
    const __mmask64 inside = _mm512_mask_cmplt_epu8_mask(
        inside_columns, _mm512_sub_epi8(quarter_rows, _mm512_set1_epi8(static_cast<char>(4 * row_begin))),
        _mm512_set1_epi8(static_cast<char>(4 * (row_end - row_begin))));

    const __m512i in_row = _mm512_permutexvar_epi8(half_columns, Load(kTables.byte_of_half));
    const __m512i bits = _mm512_permutexvar_epi8(half_columns, Load(kTables.bits_of_half));
    // Computes (quarter_rows & 0x3C) | in_row.
    const __m512i index = _mm512_ternarylogic_epi32(quarter_rows, _mm512_set1_epi8(0x3C), in_row, 0xEA);
    const __m512i bytes = _mm512_permutex2var_epi8(left, index, right);
    Seen seen;
    seen.known = _mm512_mask_test_epi8_mask(inside, bytes, bits);
    seen.hazard =
        _mm512_mask_test_epi8_mask(inside, bytes, _mm512_and_si512(bits, _mm512_set1_epi8(static_cast<char>(0xAA))));
    return seen;
  }

  Seen ReadByGathers(std::int64_t first_u, std::int64_t first_v) const {
    const __m512i width = _mm512_set1_epi32(static_cast<int>(block_.width_q));
    const __m512i height = _mm512_set1_epi32(static_cast<int>(block_.height_q));
    Seen seen;
    for (int i = 0; i < 4; ++i) {
      const __m512i u = _mm512_add_epi32(_mm512_set1_epi32(static_cast<int>(first_u)), u_[i]);
      const __m512i v = _mm512_add_epi32(_mm512_set1_epi32(static_cast<int>(first_v)), v_[i]);
      const __mmask16 inside = _mm512_mask_cmplt_epu32_mask(_mm512_cmplt_epu32_mask(u, width), v, height);
      if (block_.words == nullptr) {
        seen.known |= static_cast<std::uint64_t>(inside) << (16 * i);
        continue;
      }
      const __m512i column = _mm512_srli_epi32(u, kFraction);
      const __m512i strip_start =
          _mm512_mullo_epi32(_mm512_srli_epi32(column, 4), _mm512_set1_epi32(block_.strip_words));
      const __m512i index = _mm512_add_epi32(strip_start, _mm512_srli_epi32(v, kFraction));
      const __m512i word = _mm512_mask_i32gather_epi32(_mm512_setzero_si512(), inside, index, block_.words, 4);
      const __m512i shift = _mm512_slli_epi32(_mm512_and_si512(column, _mm512_set1_epi32(15)), 1);
      const __m512i cell = _mm512_srlv_epi32(word, shift);
      const std::uint64_t known = _mm512_mask_test_epi32_mask(inside, cell, _mm512_set1_epi32(3));
      const std::uint64_t hazard = _mm512_mask_test_epi32_mask(inside, cell, _mm512_set1_epi32(2));
      seen.known |= known << (16 * i);
      seen.hazard |= hazard << (16 * i);
    }
    return seen;
  }

  const KernelBlock& block_;
  const SquareReach& reach_;
  Way way_ = Way::kOneByOne;
  // Offsets of u and v from a square's first cell to each of its cells, two rows per register. Shifted left by kShiftU
  // and kShiftV if way_ is kWindow.
  __m512i u_[4];
  __m512i v_[4];
};

constexpr GatherKernel kKernel{"avx512", GatherInto<Avx512View>, WouldWin<Avx512View>, SquaresThatMayKnow<Avx512View>};

}  // namespace

const GatherKernel* Avx512Kernel() { return &kKernel; }

}  // namespace moondb
#else
namespace moondb {
const GatherKernel* Avx512Kernel() { return nullptr; }
}  // namespace moondb
#endif
