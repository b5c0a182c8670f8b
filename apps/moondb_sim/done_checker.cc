#include "apps/moondb_sim/done_checker.h"

#include <algorithm>
#include <utility>

#include "model/data_types.h"
#include "model/term.h"
#include "runtime/team/role_signature.h"
#include "runtime/team/team_config.h"

namespace moondb::simulation {
namespace {

// Longest time that an order's requester waits for the answer. Less than the 60 s after which the operator repeats each
// kind of order.
constexpr double kWait_s = 55;

std::string Name(AgentId sender, AgentId destination) {
  return "agent " + std::to_string(sender) + " to agent " + std::to_string(destination);
}

bool HasPair(const proto::ShareProgress& progress, AgentId sender, AgentId destination) {
  return std::any_of(progress.pairs().begin(), progress.pairs().end(), [&](const proto::PairProgress& pair) {
    return pair.sender() == sender && pair.destination() == destination && pair.is_complete();
  });
}

}  // namespace

void DoneChecker::Order(AgentId leader, proto::SharingKind kind) {
  Waiting waiting{leader, kind, ReadStores()};
  last_ = waiting.before;
  proto::Message message;
  message.set_request_id(++last_request_id_);
  message.mutable_share_request()->set_kind(kind);
  message.mutable_share_request()->set_wait_s(kWait_s);
  const bool is_sync = kind == proto::SHARING_KIND_SYNC;
  (void)world_.team.Post({leader, "operator"}, {leader, is_sync ? actor_name::kSync : actor_name::kReplica},
                         std::move(message));
  waiting_[last_request_id_] = std::move(waiting);
}

DoneChecker::Stores DoneChecker::ReadStores() {
  Stores stores;
  for (AgentId agent = 1; agent <= world_.base; ++agent) {
    if (!world_.team.is_running(agent)) continue;
    if (std::optional<HaveSet> have = world_.HaveOf(agent)) stores[agent] = *std::move(have);
  }
  return stores;
}

bool DoneChecker::HasAnswers() {
  for (AgentId agent = 1; agent <= world_.base; ++agent) {
    for (const proto::Message& message : world_.team.TakeMessages({agent, "operator"})) {
      auto waiting = waiting_.extract(message.request_id());
      if (!waiting.empty() && message.has_share_reply()) {
        answers_.emplace_back(std::move(waiting.mapped()), message.share_reply());
      }
    }
  }
  return !answers_.empty();
}

void DoneChecker::CheckAnswers() {
  for (const auto& [waiting, reply] : std::exchange(answers_, {})) {
    if (!reply.progress().is_complete() || waiting.leader == world_.byzantine) continue;
    world_.rare_states.Count(waiting.kind == proto::SHARING_KIND_SYNC ? "sync_done" : "replication_done");
    if (const auto wrong = WhyNotDone(waiting, reply.progress())) {
      world_.Violate("done_is_true",
                     "agent " + std::to_string(waiting.leader) + " answers that its order is complete, but " + *wrong);
    }
  }
  // Orders to a leader whose actor or process has restarted are never answered. Keep only the newest open orders.
  while (waiting_.size() > 64) waiting_.erase(waiting_.begin());
}

void DoneChecker::OnRoles(AgentId agent) {
  roles_changed_at_[agent] = world_.team.now();
  before_term_of_[agent] = last_;
}

// Clears the have-sets of open orders, because the agent may have lost records that these have-sets would require.
void DoneChecker::OnDiskLost(AgentId agent) {
  last_.erase(agent);
  for (auto& [leader, stores] : before_term_of_) stores.erase(agent);
  std::erase_if(waiting_, [agent](const auto& waiting) { return waiting.second.leader == agent; });
  for (auto& [id, waiting] : waiting_) waiting.before.clear();
}

std::optional<std::string> DoneChecker::WhyNotDone(const Waiting& waiting, const proto::ShareProgress& progress) {
  const AgentId leader = waiting.leader;
  const proto::RoleAssignment& roles = world_.roles[leader];
  // The leader's actors receive new roles one after another, so their terms may differ at this instant.
  const bool is_just_changed = roles_changed_at_[leader] == world_.team.now() || !world_.team.is_running(leader);
  if (!is_just_changed && OrderOf(roles.term()) != OrderOf(progress.term())) {
    return "it acts on term " + TermText(roles.term()) + ", and answers for term " + TermText(progress.term());
  }
  const bool is_sync = waiting.kind == proto::SHARING_KIND_SYNC;
  const Stores now = ReadStores();
  for (AgentId other = 1; other <= world_.base; ++other) {
    if (other == leader || other == world_.byzantine) continue;
    // In a team with keys, a rover that never had a role does not forward other agents' records.
    const bool is_believed = !HasSigningKeys(world_.config) || world_.invariants.HasHadRole(other);
    const auto is_of_others = [&](const RecordKey& key) { return key.stream.origin != other && is_believed; };
    if (const auto lacking = WhyLacking(before_term_of_[leader], now, other, leader, is_of_others)) return lacking;
    if (is_sync) {
      const auto is_its_own = [other](const RecordKey& key) { return key.stream.origin == other; };
      const auto is_for_it = [&](const RecordKey& key) { return is_its_own(key) || IsBroughtOn(key, other); };
      if (!HasPair(progress, other, leader)) return Name(other, leader) + " is left out";
      if (!HasPair(progress, leader, other)) return Name(leader, other) + " is left out";
      if (const auto lacking = WhyLacking(waiting.before, now, other, leader, is_its_own)) return lacking;
      if (const auto lacking = WhyLacking(waiting.before, now, leader, other, is_for_it)) return lacking;
      for (const auto& [third, have] : waiting.before) {
        const auto is_from_third = [&, third = third](const RecordKey& key) {
          return key.stream.origin == third && third != other && IsBroughtOn(key, other);
        };
        if (const auto lacking = WhyLacking({{leader, have}}, now, leader, other, is_from_third)) return lacking;
      }
    } else if (other == roles.survivor()) {
      if (!HasPair(progress, leader, other)) return Name(leader, other) + " is left out";
      if (const auto lacking = WhyLacking(waiting.before, now, leader, other, [](const RecordKey&) { return true; }))
        return lacking;
    }
  }
  return std::nullopt;
}

bool DoneChecker::IsBroughtOn(const RecordKey& key, AgentId destination) const {
  const DataType type = key.stream.type;
  if (destination == world_.base) return type == proto::POSE_GRAPH_NODE || type == proto::LOCAL_TRAVERSABILITY_MAP;
  return RoversPolicyOf(world_.config, type) == proto::POLICY_ALL;
}

template <typename IsMeant>
std::optional<std::string> DoneChecker::WhyLacking(const Stores& stores, const Stores& now, AgentId sender,
                                                   AgentId destination, IsMeant is_meant) const {
  const auto before = stores.find(sender);
  if (before == stores.end()) return std::nullopt;
  const auto at_sender = now.find(sender);
  const auto there = now.find(destination);
  if (at_sender == now.end() || there == now.end()) return std::nullopt;
  for (const auto& [stream, have] : before->second.streams()) {
    // Skip notes: whether an agent keeps a note depends on when its policy changed.
    if (stream.type == kNote || stream.origin == world_.byzantine || !is_meant(RecordKey{stream, 1})) continue;
    // A destination that dropped a state must hold a newer state.
    const StreamHave& covered = there->second.Get(stream);
    const IntervalSet lacking = have.held.Minus(IsState(stream.type) ? covered.held : covered.Covered());
    for (const IntervalSet::Interval& interval : lacking.intervals()) {
      for (std::uint64_t seq = interval.first; seq <= interval.last; ++seq) {
        const RecordKey key{stream, seq};
        const bool is_pruned = !MayBeSuperseded(stream.type) && at_sender->second.Get(stream).dropped.Contains(seq);
        if (is_pruned || world_.invariants.IsReplacedIn(there->second, key)) continue;
        return Name(sender, destination) + ": " + ToString(key) + " is not there";
      }
    }
  }
  return std::nullopt;
}

}  // namespace moondb::simulation
