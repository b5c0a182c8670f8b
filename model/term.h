// The order of terms: number, then issuer, then the issuer's epoch; limits of what assignments of roles hold.
#pragma once

#include <cstddef>
#include <cstdint>
#include <tuple>

#include "proto/types.pb.h"

namespace moondb {

// A new leader each millisecond would need thirty years for so many: a larger number is damaged or forged.
inline constexpr std::uint64_t kTermNumberMax = 1ull << 40;

// Why roles change, as people give it.
inline constexpr std::size_t kRoleReasonBytesMax = 256;

inline auto OrderOf(const proto::Term& term) { return std::tuple(term.number(), term.issuer(), term.issuer_epoch()); }
inline bool IsNewer(const proto::Term& a, const proto::Term& b) { return OrderOf(a) > OrderOf(b); }

}  // namespace moondb
