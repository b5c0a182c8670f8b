#include "model/term.h"

namespace moondb {

std::string TermText(const proto::Term& term) {
  const std::string change = std::to_string(ChangeOf(term));
  return ReignOf(term) == 0 ? change : std::to_string(ReignOf(term)) + "." + change;
}

}  // namespace moondb
