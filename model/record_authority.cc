#include "model/record_authority.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "model/data_types.h"
#include "model/record_check.h"

namespace moondb {
namespace {

// The term in which the record's origin claims to lead; null for a record that claims no role.
const proto::Term* ClaimedTermOf(const RecordKey& key, const proto::Record& record) {
  switch (record.body_case()) {
    case proto::Record::kOptimizedPose:
      return &record.optimized_pose().term();
    case proto::Record::kEdgeVerdict:
      return &record.edge_verdict().term();
    case proto::Record::kMapQuarantine:
      return NeedsRole(record.map_quarantine(), key.stream.origin) ? &record.map_quarantine().term() : nullptr;
    default:
      return nullptr;
  }
}

}  // namespace

Result<void> CheckSpeaker(const proto::Record& record, AgentId origin) {
  const DataTypeRow* row = FindDataType(TypeOf(record));
  if (row == nullptr || row->speaker != Speaker::kNamedAgent) return {};
  const std::vector<NamedAgent> named = AgentsNamedIn(record);
  if (std::ranges::find(named, origin, &NamedAgent::agent) != named.end()) return {};
  const bool is_of_two = named.front().agent != named.back().agent;
  return Fail(ErrorCode::kInvalid,
              is_of_two ? "joins agents " + std::to_string(named.front().agent) + " and " +
                              std::to_string(named.back().agent) + "; only one of these inserts it"
                        : "belongs to agent " + std::to_string(named.front().agent) + "; only that agent inserts it",
              named.front().field);
}

bool NeedsRole(const proto::MapQuarantine& quarantine, AgentId origin) {
  return (quarantine.has_lifts() ? quarantine.lifts().origin_agent() : quarantine.agent_id()) != origin;
}

RecordAuthority::RecordAuthority(RoleChain::Options options)
    : has_keys_(options.has_keys), may_command_(options.may_command), chain_(std::move(options)) {}

bool RecordAuthority::Counts(const RecordKey& key, const proto::Record& record) {
  if (has_keys_ && record.has_role_assignment()) AddAssignment(record.role_assignment());
  if (MayState(key, record)) return true;
  ++uncounted_[key.stream.origin];
  return false;
}

bool RecordAuthority::MayState(const RecordKey& key, const proto::Record& record) {
  if (!CheckSpeaker(record, key.stream.origin)) return false;
  const proto::Term* term = has_keys_ ? ClaimedTermOf(key, record) : nullptr;
  if (term == nullptr) return true;
  if (record.has_map_quarantine() && may_command_(key.stream.origin)) return true;
  return HasLedIn(key.stream.origin, *term);
}

bool RecordAuthority::HasLedIn(AgentId origin, const proto::Term& term) {
  if (chain_.HasLedIn(origin, term)) return true;
  if (left_out_.size() < kLeftOutMax) left_out_.insert({origin, OrderOf(term)});
  return false;
}

// One assignment may let others count that waited for it, so each left-out claim is judged again.
void RecordAuthority::AddAssignment(const proto::RoleAssignment& roles) {
  const std::size_t before = chain_.size();
  (void)chain_.Add(roles);
  if (chain_.size() == before || left_out_.empty()) return;
  is_outdated_ = is_outdated_ || left_out_.size() >= kLeftOutMax;
  for (const auto& [origin, order] : left_out_) {
    proto::Term term;
    term.set_number(std::get<0>(order));
    term.set_issuer(std::get<1>(order));
    term.set_issuer_epoch(std::get<2>(order));
    is_outdated_ = is_outdated_ || chain_.HasLedIn(origin, term);
  }
}

bool RecordAuthority::TakeOutdated() { return std::exchange(is_outdated_, false); }

std::optional<proto::UncountedReport> RecordAuthority::TakeReport() {
  if (uncounted_ == reported_) return std::nullopt;
  reported_ = uncounted_;
  proto::UncountedReport report;
  for (const auto& [origin, count] : uncounted_) {
    (*report.mutable_count_of_origin())[origin] = static_cast<double>(count);
  }
  return report;
}

void RecordAuthority::BeginAnew() {
  left_out_.clear();
  uncounted_.clear();
}

}  // namespace moondb
