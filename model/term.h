// The order of terms: number, then issuer, then the issuer's epoch; limits of what assignments of roles hold.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <tuple>

#include "proto/term.pb.h"

namespace moondb {

// Term.number holds two counts: of reigns, each begun by an agent that may command the team, in the bits from this one
// on, and below of the changes of roles within the reign. So terms are ordered by reign first, and what is versioned by
// a term needs no field more.
inline constexpr int kEraShift = 32;
inline constexpr std::uint64_t kEraMax = (1ull << 20) - 1;
inline constexpr std::uint64_t kRevisionMax = (1ull << kEraShift) - 1;
// JSON's numbers hold it exactly.
inline constexpr std::uint64_t kTermNumberMax = kEraMax << kEraShift | kRevisionMax;

inline std::uint64_t EraOf(const proto::Term& term) { return term.number() >> kEraShift; }
inline std::uint64_t RevisionOf(const proto::Term& term) { return term.number() & kRevisionMax; }
inline std::uint64_t TermNumber(std::uint64_t era, std::uint64_t revision) { return era << kEraShift | revision; }
// "7" in the reign of the team file, "2.7" in the second one after it.
std::string TermText(const proto::Term& term);

inline constexpr std::size_t kSignatureBytes = 64;  // Ed25519.

// Why roles change, as people give it.
inline constexpr std::size_t kRoleReasonBytesMax = 256;

inline auto OrderOf(const proto::Term& term) { return std::tuple(term.number(), term.issuer(), term.issuer_epoch()); }
inline bool IsNewer(const proto::Term& a, const proto::Term& b) { return OrderOf(a) > OrderOf(b); }

}  // namespace moondb
