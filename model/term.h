// The order of terms (number, then issuer, then the issuer's epoch), and size limits of role assignments.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <tuple>

#include "proto/term.pb.h"

namespace moondb {

// Term.number combines two counters. The bits from kEraShift up are the era (EraOf); only an agent that may command the
// team can begin a new era. The lower bits are the revision of the roles within the era (RevisionOf).
inline constexpr int kEraShift = 32;
inline constexpr std::uint64_t kEraMax = (1ull << 20) - 1;
inline constexpr std::uint64_t kRevisionMax = (1ull << kEraShift) - 1;
// The largest term number. A JSON number (a double) can represent it exactly.
inline constexpr std::uint64_t kTermNumberMax = kEraMax << kEraShift | kRevisionMax;

inline std::uint64_t EraOf(const proto::Term& term) { return term.number() >> kEraShift; }
inline std::uint64_t RevisionOf(const proto::Term& term) { return term.number() & kRevisionMax; }
inline std::uint64_t TermNumber(std::uint64_t era, std::uint64_t revision) { return era << kEraShift | revision; }
// Returns "7" for revision 7 in the team file's era (0), and "2.7" for revision 7 in era 2.
std::string TermText(const proto::Term& term);

inline constexpr std::size_t kSignatureBytes = 64;  // Size of an Ed25519 signature.

inline constexpr std::size_t kRoleReasonBytesMax = 256;

inline auto OrderOf(const proto::Term& term) { return std::tuple(term.number(), term.issuer(), term.issuer_epoch()); }
inline bool IsNewer(const proto::Term& a, const proto::Term& b) { return OrderOf(a) > OrderOf(b); }

}  // namespace moondb
