// The order of terms: number, then issuer, then the issuer's epoch.
#pragma once

#include <tuple>

#include "proto/types.pb.h"

namespace moondb {

inline auto OrderOf(const proto::Term& term) { return std::tuple(term.number(), term.issuer(), term.issuer_epoch()); }
inline bool IsNewer(const proto::Term& a, const proto::Term& b) { return OrderOf(a) > OrderOf(b); }

}  // namespace moondb
