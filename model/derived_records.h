// DerivedRecords: which optimized poses and verdicts count. Anybody can store some; they count where an assignment of
// their term that counts (model/role_chain.h) names their origin leader. So no rover that never led moves the others'
// maps, however high a term it gives, and which ones count depends on the records alone.
//
// Fed with the records that are held, in any order. What came before its assignment is left out; when that is there, all
// has to be read anew. A plain value, not copied.
#pragma once

#include <cstdint>
#include <set>
#include <tuple>

#include "model/record_key.h"
#include "model/role_chain.h"
#include "model/term.h"
#include "proto/record.pb.h"

namespace moondb {

class DerivedRecords {
 public:
  explicit DerivedRecords(RoleChain::Options options);

  // False for a pose or verdict that does not count, or does not yet. Takes assignments.
  bool Counts(const RecordKey& key, const proto::Record& record);
  // Whether something that was left out counts by now; then it is to be read anew, and this says so once.
  bool TakeOutdated();

 private:
  // Solves that were left out are remembered up to so many; beyond, any new assignment may concern one.
  static constexpr std::size_t kLeftOutMax = 4096;
  using Solve = std::tuple<AgentId, decltype(OrderOf(proto::Term()))>;  // Its origin and term.

  bool CountsIn(AgentId origin, const proto::Term& term);

  const bool has_keys_;
  RoleChain chain_;
  std::set<Solve> left_out_;
  bool is_outdated_ = false;
};

}  // namespace moondb
