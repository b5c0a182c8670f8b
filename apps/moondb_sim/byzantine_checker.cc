#include "apps/moondb_sim/byzantine_checker.h"

#include "model/data_types.h"
#include "model/record_authority.h"
#include "model/record_check.h"
#include "proto/types.pb.h"

namespace moondb::simulation {
namespace {

std::string ByzantineName(AgentId agent) { return "agent " + std::to_string(agent); }

}  // namespace

void ByzantineChecker::OnForged(const proto::Record& record) { forged_.merge(StatementHashes(record)); }

void ByzantineChecker::OnImpossible(const RecordKey& key) { impossible_.insert(key); }

// Returns whether the Byzantine agent forged the record in another agent's name.
bool ByzantineChecker::IsMadeUp(const proto::StoredRecord& record) const {
  return record.key().origin_agent() != liar_ && forged_.contains(ContentHash(record.content()));
}

void ByzantineChecker::OnStoreRequest(AgentId agent, const proto::Message& message) {
  const proto::StoreRequest& request = message.store_request();
  if (liar_ == 0 || agent == liar_) return;
  Expected expected;
  if (request.sender() == liar_) {
    expected.may_store = 0;
    for (const proto::StoredRecord& record : request.records()) {
      expected.may_store += IsMadeUp(record) || IsSlander(record) ? 0 : 1;
    }
  } else {
    // Records of the Byzantine agent may be refused, because it may send different peers different contents of one
    // record.
    expected.may_refuse = 0;
    for (const proto::StoredRecord& record : request.records()) {
      expected.may_refuse += record.key().origin_agent() == liar_ ? 1 : 0;
      OnRecord(agent, FromProto(record.key()), record.content());
    }
    for (const proto::StreamHave& dropped : request.dropped()) {
      expected.may_refuse += dropped.origin_agent() == liar_ ? 1 : 0;
    }
  }
  expected_[{agent, message.request_id()}] = expected;
}

// Returns whether the record's origin may not write the record in any role (CheckSpeaker).
bool ByzantineChecker::IsSlander(const proto::StoredRecord& stored) {
  proto::Record record;
  return record.ParseFromString(stored.content()) && CheckRecord(record) &&
         !CheckSpeaker(record, stored.key().origin_agent());
}

bool ByzantineChecker::OnStoreReply(AgentId agent, const proto::Message& message) {
  const auto expected = expected_.find({agent, message.request_id()});
  if (expected == expected_.end()) return false;
  const auto [may_store, may_refuse] = expected->second;
  expected_.erase(expected);
  const proto::StoreReply& reply = message.store_reply();
  if (reply.stored_count() > may_store && !is_trusted_) {
    report_("only_own_lies", ByzantineName(agent) + " stores " + std::to_string(reply.stored_count()) + " records of " +
                                 ByzantineName(liar_) + ", of which " + std::to_string(may_store) + " are not made up");
  }
  return reply.rejected_count() <= may_refuse;
}

void ByzantineChecker::OnRecord(AgentId agent, const RecordKey& key, const std::string& content) const {
  if (!IsLie(agent, key.stream.origin) || !forged_.contains(ContentHash(content))) return;
  report_("only_own_lies",
          ByzantineName(agent) + " has " + ToString(key) + ", which " + ByzantineName(liar_) + " made up");
}

void ByzantineChecker::OnRoles(AgentId agent, const proto::RoleAssignment& roles) {
  if (liar_ == 0 || agent == liar_) return;
  const bool is_own = roles.term().issuer() == liar_ && !is_trusted_;
  if (is_own || roles.reason() == kByzantineReason) {
    report_("honest_roles", ByzantineName(agent) + " acts on roles by the word of " + ByzantineName(liar_) + ": " +
                                roles.ShortDebugString());
  }
  OnRolesStored(agent, roles);
}

void ByzantineChecker::OnRolesStored(AgentId agent, const proto::RoleAssignment& roles) {
  if (liar_ == 0 || agent == liar_) return;
  if (roles.leader() == liar_ || roles.survivor() == liar_) is_trusted_ = true;
}

void ByzantineChecker::CheckHave(AgentId agent, const HaveSet& have) const {
  for (const RecordKey& key : impossible_) {
    if (!IsLie(agent, key.stream.origin) || !have.Get(key.stream).Covered().Contains(key.seq)) continue;
    return report_("only_own_lies", ByzantineName(agent) + " had " + ToString(key) + ", which there never was");
  }
}

void ByzantineChecker::CheckQuiescent(const QuiescentTeam& team) const {
  if (liar_ == 0 || is_trusted_) return;
  const Records& leaders = team.records.at(team.leader);
  for (const auto& [agent, records] : team.records) {
    for (const auto& [key, content] : records) {
      if (!IsLie(agent, key.stream.origin)) continue;
      OnRecord(agent, key, content);
      if (key.stream.type == kNote) continue;  // Agents with different policies hold different notes.
      const auto same = leaders.find(key);
      const bool is_covered = team.have.at(team.leader).Get(key.stream).Covered().Contains(key.seq);
      const bool is_passed_on = agent == key.stream.origin || !team.never_had_role.contains(agent);
      if (same == leaders.end() && !is_passed_on) continue;
      const bool converges = same != leaders.end() ? same->second == content : is_covered || IsDerived(key.stream.type);
      if (converges) continue;
      return report_("honest_converge", ByzantineName(agent) + " holds " + ToString(key) + ", and the leader, " +
                                            ByzantineName(team.leader) +
                                            (same == leaders.end() ? ", had it never" : ", another content of it"));
    }
  }
}

}  // namespace moondb::simulation
