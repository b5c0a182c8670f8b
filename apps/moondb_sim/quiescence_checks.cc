#include "apps/moondb_sim/quiescence_checks.h"

#include <string>

#include "apps/moondb_sim/client_message.h"
#include "apps/moondb_sim/simulated_config.h"
#include "model/control_message.h"
#include "model/record_hash.h"
#include "model/term.h"
#include "proto/control.pb.h"
#include "runtime/team/team_config.h"

namespace moondb::simulation {

using std::chrono::minutes;

void QuiescenceChecks::CheckHistory(AgentId agent, const HaveSet& have) {
  proto::Message question;
  question.mutable_read_request()->set_is_history(true);
  question.mutable_read_request()->set_records_max(10'000);
  const proto::Message answer = world_.RequestActor(agent, actor_name::kStorage, std::move(question));
  proto::ControlRequest request;
  request.mutable_status();
  const auto sums = ControlReplyOf(world_.RequestActor(agent, actor_name::kStorage, MessageOf(request)));
  const proto::StorageStatus& status = sums ? sums->status().storage() : proto::StorageStatus::default_instance();
  std::string wrong;
  for (const proto::StoredRecord& record : answer.read_reply().records()) {
    const RecordKey key = FromProto(record.key());
    const bool is_held = key.seq != 0 && have.Get(key.stream).held.Contains(key.seq);
    if (key.stream.origin != agent || is_held || HashRecord(key, record.content()) != record.hash()) {
      wrong = ToString(key);
    }
  }
  const double count = status.history_count();
  if (answer.read_reply().records_size() != count) wrong = "its sums";
  if (status.history_bytes() > world_.config.retention().history_mb_max() * 1e6) wrong = "its size";
  if (!wrong.empty()) world_.Violate("history_is_own", "agent " + std::to_string(agent) + ": " + wrong);
}

void QuiescenceChecks::Check() {
  const std::optional<proto::RoleAssignment> roles = CheckRoles();
  if (!roles) return;
  QuiescentTeam team{roles->leader(), roles->survivor(), world_.base, {}, {}, {}};
  for (const DataType type : DataTypesOf(world_.config)) {
    if (GroundPolicyOf(world_.config, type) == proto::POLICY_NONE) team.not_for_ground.insert(type);
    if (RoversPolicyOf(world_.config, type) != proto::POLICY_NONE) team.for_rovers.insert(type);
  }
  for (AgentId agent = 1; agent <= world_.base; ++agent) {
    restarts_.CheckFailures(agent);
    const std::optional<HaveSet> have = world_.HaveOf(agent);
    if (!have) return world_.Violate("starts", "storage of agent " + std::to_string(agent) + " does not answer");
    team.have[agent] = *have;
    if (const auto wrong = prunes_.at(agent).OnHave(*have)) {
      world_.Violate("pruned_is_covered", "agent " + std::to_string(agent) + " " + *wrong);
    }
    CheckHistory(agent, *have);
    team.records[agent] = world_.ReadAll(agent);
  }
  for (AgentId agent = 1; agent <= world_.base; ++agent) {
    if (!world_.invariants.HasHadRole(agent)) team.never_had_role.insert(agent);
  }
  byzantine_.CheckQuiescent(team);
  // If the Byzantine agent ever had a role, other agents may have accepted its lies, so invariants cannot be checked.
  if (!byzantine_.is_trusted()) world_.invariants.CheckQuiescent(team);
  if (world_.options.has_all_actors()) clients_.CheckQuiescent();
  CheckBytesEnd();
  for (AgentId agent = 1; agent <= world_.base; ++agent) {
    if (agent != world_.byzantine) CheckSessions(agent);
    restarts_.CheckMailboxes(agent);
  }
}

std::optional<proto::RoleAssignment> QuiescenceChecks::CheckRoles() {
  std::optional<proto::RoleAssignment> roles;
  for (AgentId agent = 1; agent <= world_.base; ++agent) {
    if (agent == world_.byzantine) continue;
    const std::string who = "agent " + std::to_string(agent);
    proto::Message question;
    question.mutable_role_show_request();
    const proto::Message answer = world_.team.is_running(agent)
                                      ? world_.RequestActor(agent, actor_name::kRole, std::move(question))
                                      : proto::Message();
    if (!answer.has_role_show_reply() || !world_.roles.contains(agent)) {
      world_.Violate(world_.team.is_running(agent) ? "one_leader" : "starts",
                     who + " does not run, or does not know its roles");
      return std::nullopt;
    }
    const proto::RoleAssignment& shown = answer.role_show_reply().roles();
    if (!roles) roles = shown;
    for (const proto::RoleAssignment& its : {shown, world_.roles[agent]}) {
      if (its.SerializeAsString() == roles->SerializeAsString()) continue;
      world_.Violate("one_leader", who + " has term " + its.term().ShortDebugString() + ", agent 1 " +
                                       roles->term().ShortDebugString());
      return std::nullopt;
    }
  }
  return roles;
}

std::uint64_t QuiescenceChecks::StatesBytesMax(Duration length) const {
  constexpr double kSessionBytesMax = 4096;
  const double period_s = world_.config.radio().states_period_s();
  if (period_s <= 0) return 0;
  const double sessions = (std::chrono::duration<double>(length).count() / period_s + 1) * world_.base;
  return static_cast<std::uint64_t>(sessions * kSessionBytesMax);
}

std::uint64_t QuiescenceChecks::FlowBytesMax(Duration length) const {
  constexpr double kSessionBytesMax = 8192;
  const double period_s = std::max(world_.config.radio().sync_period_s(), 60.0);
  if (world_.config.radio().sync_period_s() <= 0) return 0;
  const double sessions = (std::chrono::duration<double>(length).count() / period_s + 1) * 2 * world_.base;
  return static_cast<std::uint64_t>(sessions * kSessionBytesMax);
}

std::uint64_t QuiescenceChecks::LeaderCheckBytesMax(Duration length) const {
  constexpr double kCheckBytesMax = 128;
  if (world_.config.roles().failover() != proto::FAILOVER_AUTOMATIC) return 0;
  const double period_s = world_.config.roles().leader_timeout_s() / 3;
  return static_cast<std::uint64_t>((std::chrono::duration<double>(length).count() / period_s + 1) * kCheckBytesMax);
}

void QuiescenceChecks::CheckBytesEnd() {
  world_.team.AdvanceTime(minutes(1));  // Let the last orders finish; no more orders follow.
  const std::uint64_t before = world_.team.radio_bytes();
  world_.team.AdvanceTime(minutes(10));
  const std::uint64_t bytes = world_.team.radio_bytes() - before;
  if (bytes <= FlowBytesMax(minutes(10)) + StatesBytesMax(minutes(10)) + LeaderCheckBytesMax(minutes(10))) return;
  world_.Violate("comes_to_rest", std::to_string(bytes) + " bytes in ten minutes without orders");
}

void QuiescenceChecks::CheckSessions(AgentId agent) {
  for (const char* actor : {actor_name::kSync, actor_name::kReplica}) {
    proto::ControlRequest request;
    request.mutable_share_status();
    const auto answer = ControlReplyOf(world_.RequestActor(agent, actor, MessageOf(request)));
    if (!answer) continue;
    const proto::ShareStatus& status = answer->share_status();
    for (const proto::ShareSession& session : status.sessions()) {
      // A periodic session may be open at any time. CheckBytesEnd limits its bytes.
      if ((!session.is_open() || session.is_periodic()) && session.remaining() == 0) continue;
      world_.Violate("comes_to_rest", "agent " + std::to_string(agent) + ": " + session.ShortDebugString());
    }
    if (status.damaged_messages() > 0 && world_.byzantine == 0) {
      world_.Violate("nothing_refused", "agent " + std::to_string(agent) + " could not decode messages");
    }
  }
}

}  // namespace moondb::simulation
