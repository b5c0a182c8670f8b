#include "model/record_authority.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "model/data_types.h"
#include "model/record_check.h"

namespace moondb {
namespace {

// Returns the rule of the record's type; kAnyAgent for types without a row.
Speaker SpeakerOf(const proto::Record& record) {
  const DataTypeRow* row = FindDataType(TypeOf(record));
  return row == nullptr ? Speaker::kAnyAgent : row->speaker;
}

// Returns the term in which the record's origin claims to have led. Requires: the record's speaker is kLeader or
// kNamedAgentOrLeader.
const proto::Term& ClaimedTermOf(const proto::Record& record) { return FindDataType(TypeOf(record))->term(record); }

}  // namespace

bool IsNamedIn(const proto::Record& record, AgentId agent) {
  const std::vector<NamedAgent> named = AgentsNamedIn(record);
  return std::ranges::find(named, agent, &NamedAgent::agent) != named.end();
}

Result<void> CheckSpeaker(const proto::Record& record, AgentId origin) {
  if (SpeakerOf(record) != Speaker::kNamedAgent || IsNamedIn(record, origin)) return {};
  const std::vector<NamedAgent> named = AgentsNamedIn(record);
  const bool is_of_two = named.front().agent != named.back().agent;
  return Fail(ErrorCode::kInvalid,
              is_of_two ? "joins agents " + std::to_string(named.front().agent) + " and " +
                              std::to_string(named.back().agent) + "; only one of these inserts it"
                        : "belongs to agent " + std::to_string(named.front().agent) + "; only that agent inserts it",
              named.front().field);
}

RecordAuthority::RecordAuthority(RoleChain::Options options)
    : has_keys_(options.has_keys), may_command_(options.may_command), chain_(std::move(options)) {}

bool RecordAuthority::Counts(const RecordKey& key, const proto::Record& record) {
  if (has_keys_ && record.has_role_assignment()) AddAssignment(record.role_assignment());
  if (MayState(key.stream.origin, record)) return true;
  ++uncounted_[key.stream.origin];
  return false;
}

bool RecordAuthority::MayState(AgentId origin, const proto::Record& record) {
  switch (SpeakerOf(record)) {
    case Speaker::kAnyAgent:
      return true;
    case Speaker::kNamedAgent:
      return IsNamedIn(record, origin);
    case Speaker::kNamedAgentOrCommander:
      return !has_keys_ || IsNamedIn(record, origin) || may_command_(origin);
    case Speaker::kLeader:
      return !has_keys_ || HasLedIn(origin, ClaimedTermOf(record));
    case Speaker::kNamedAgentOrLeader:
      return !has_keys_ || IsNamedIn(record, origin) || may_command_(origin) || HasLedIn(origin, ClaimedTermOf(record));
  }
  return false;
}

bool RecordAuthority::HasLedIn(AgentId origin, const proto::Term& term) {
  if (chain_.HasLedIn(origin, term)) return true;
  if (left_out_.size() < kLeftOutMax) left_out_.insert({origin, OrderOf(term)});
  return false;
}

// The new assignment may also make assignments valid that waited for it. Check all claims in left_out_ again.
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

std::optional<proto::Message> RecordAuthority::TakeReport(std::map<AgentId, std::uint64_t> without_room) {
  if (uncounted_ == reported_ && without_room == reported_without_room_) return std::nullopt;
  reported_ = uncounted_;
  reported_without_room_ = std::move(without_room);
  proto::Message message;
  proto::LeftOutReport& report = *message.mutable_left_out_report();
  for (const auto& [origin, count] : reported_) (*report.mutable_without_role())[origin] = static_cast<double>(count);
  for (const auto& [origin, count] : reported_without_room_) {
    (*report.mutable_without_room())[origin] = static_cast<double>(count);
  }
  return message;
}

void RecordAuthority::Restart() {
  left_out_.clear();
  uncounted_.clear();
}

}  // namespace moondb
