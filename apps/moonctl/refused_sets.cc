#include "apps/moonctl/refused_sets.h"

#include "apps/common/table.h"

namespace moondb {

std::string RefusedCount(const proto::RefusedSet& set) {
  std::string kind = set.is_range() ? "range" : set.is_prior() ? "prior" : "loop closure";
  if (set.count() != 1) kind += "s";
  return FormatCount(set.count()) + " " + kind + (set.source().empty() ? "" : " of " + set.source());
}

}  // namespace moondb
