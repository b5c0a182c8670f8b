#include "model/derived_records.h"

#include <utility>

namespace moondb {

DerivedRecords::DerivedRecords(RoleChain::Options options) : has_keys_(options.has_keys), chain_(std::move(options)) {}

bool DerivedRecords::Counts(const RecordKey& key, const proto::Record& record) {
  if (!has_keys_) return true;
  switch (record.body_case()) {
    case proto::Record::kOptimizedPose:
      return CountsIn(key.stream.origin, record.optimized_pose().term());
    case proto::Record::kEdgeVerdict:
      return CountsIn(key.stream.origin, record.edge_verdict().term());
    case proto::Record::kRoleAssignment: {
      const std::size_t before = chain_.size();
      (void)chain_.Add(record.role_assignment());
      // One may let others count that waited for it.
      if (chain_.size() != before && !left_out_.empty()) {
        is_outdated_ = is_outdated_ || left_out_.size() >= kLeftOutMax;
        for (const auto& [origin, order] : left_out_) {
          proto::Term term;
          term.set_number(std::get<0>(order));
          term.set_issuer(std::get<1>(order));
          term.set_issuer_epoch(std::get<2>(order));
          is_outdated_ = is_outdated_ || chain_.HasLedIn(origin, term);
        }
      }
      return true;
    }
    default:
      return true;
  }
}

bool DerivedRecords::CountsIn(AgentId origin, const proto::Term& term) {
  if (chain_.HasLedIn(origin, term)) return true;
  if (left_out_.size() < kLeftOutMax) left_out_.insert({origin, OrderOf(term)});
  return false;
}

bool DerivedRecords::TakeOutdated() {
  if (!std::exchange(is_outdated_, false)) return false;
  left_out_.clear();
  return true;
}

}  // namespace moondb
