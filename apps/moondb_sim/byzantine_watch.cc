#include "apps/moondb_sim/byzantine_watch.h"

#include <algorithm>

namespace moondb::simulation {
namespace {

std::string NameOf(AgentId agent) { return "agent " + std::to_string(agent); }

// A rover that never led does not pass on what a leader that is gone derived: the next one solves anew.
bool IsDerived(DataType type) { return type == proto::OPTIMIZED_POSE || type == proto::EDGE_VERDICT; }

}  // namespace

void ByzantineWatch::OnForged(const proto::Record& record) {
  forged_.insert(ContentHash(record.SerializeAsString()));
  proto::Record marked = record;  // As an agent stores what it is to insert while its clock is suspect.
  marked.set_is_clock_suspect(true);
  forged_.insert(ContentHash(marked.SerializeAsString()));
}

void ByzantineWatch::OnImpossible(const RecordKey& key) { impossible_.insert(key); }

// What it did not make up is no lie, whoever may bring it.
bool ByzantineWatch::IsMadeUp(const proto::StoredRecord& record) const {
  return record.key().origin_agent() != liar_ && forged_.contains(ContentHash(record.content()));
}

void ByzantineWatch::OnStoreRequest(AgentId agent, const proto::Message& message) {
  const proto::StoreRequest& request = message.store_request();
  if (liar_ == 0 || agent == liar_) return;
  if (request.sender() != liar_) {
    for (const proto::StoredRecord& record : request.records()) {
      OnRecord(agent, FromProto(record.key()), record.content());
    }
    return;
  }
  const auto count = std::count_if(request.records().begin(), request.records().end(),
                                   [this](const proto::StoredRecord& record) { return !IsMadeUp(record); });
  may_store_[{agent, message.request_id()}] = static_cast<std::uint32_t>(count);
}

bool ByzantineWatch::OnStoreReply(AgentId agent, const proto::Message& message) {
  const auto may_store = may_store_.find({agent, message.request_id()});
  if (may_store == may_store_.end()) return false;
  const std::uint32_t stored = message.store_reply().stored_count();
  if (stored > may_store->second && !is_trusted_) {
    report_("only_own_lies", NameOf(agent) + " stores " + std::to_string(stored) + " records of " + NameOf(liar_) +
                                 ", of which " + std::to_string(may_store->second) + " are not made up");
  }
  may_store_.erase(may_store);
  return true;
}

void ByzantineWatch::OnRecord(AgentId agent, const RecordKey& key, const std::string& content) const {
  if (!IsLie(agent, key.stream.origin) || !forged_.contains(ContentHash(content))) return;
  report_("only_own_lies", NameOf(agent) + " has " + ToString(key) + ", which " + NameOf(liar_) + " made up");
}

void ByzantineWatch::OnRoles(AgentId agent, const proto::RoleAssignment& roles) {
  if (liar_ == 0 || agent == liar_) return;
  const bool is_own = roles.term().issuer() == liar_ && !is_trusted_;
  if (is_own || roles.reason() == kByzantineReason) {
    report_("honest_roles",
            NameOf(agent) + " acts on roles by the word of " + NameOf(liar_) + ": " + roles.ShortDebugString());
  }
  if (roles.leader() == liar_ || roles.survivor() == liar_) is_trusted_ = true;
}

void ByzantineWatch::CheckHave(AgentId agent, const HaveSet& have) const {
  for (const RecordKey& key : impossible_) {
    if (!IsLie(agent, key.stream.origin) || !have.Get(key.stream).Had().Contains(key.seq)) continue;
    return report_("only_own_lies", NameOf(agent) + " had " + ToString(key) + ", which there never was");
  }
}

void ByzantineWatch::CheckRest(const TeamAtRest& team) const {
  if (liar_ == 0 || is_trusted_) return;
  const Records& leaders = team.records.at(team.leader);
  for (const auto& [agent, records] : team.records) {
    for (const auto& [key, content] : records) {
      if (!IsLie(agent, key.stream.origin)) continue;
      OnRecord(agent, key, content);
      const auto same = leaders.find(key);
      const bool is_had = team.have.at(team.leader).Get(key.stream).Had().Contains(key.seq);
      const bool converges = same != leaders.end() ? same->second == content : is_had || IsDerived(key.stream.type);
      if (converges) continue;
      return report_("honest_converge", NameOf(agent) + " holds " + ToString(key) + ", and the leader, " +
                                            NameOf(team.leader) +
                                            (same == leaders.end() ? ", had it never" : ", another content of it"));
    }
  }
}

}  // namespace moondb::simulation
