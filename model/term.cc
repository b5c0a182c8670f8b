#include "model/term.h"

namespace moondb {

std::string TermText(const proto::Term& term) {
  const std::string change = std::to_string(RevisionOf(term));
  return EraOf(term) == 0 ? change : std::to_string(EraOf(term)) + "." + change;
}

}  // namespace moondb
