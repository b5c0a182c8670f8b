#include "actors/role/failover_actor.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "model/control_message.h"
#include "model/team_member.h"
#include "model/term.h"
#include "runtime/team/team_config.h"

namespace moondb {
namespace {

enum FailoverTimer : std::uint32_t { kMissed = 0, kCheck = 1 };

// Request id of the RoleSetRequest. Only an error in the reply is evaluated; RolesChanged reports success.
constexpr std::uint64_t kTakeLead = 1;

constexpr int kChecksInTimeout = 3;

}  // namespace

FailoverActor::FailoverActor(Options options)
    : options_(std::move(options)),
      leader_timeout_(std::chrono::duration_cast<Duration>(
          std::chrono::duration<double>(options_.team.roles().leader_timeout_s()))),
      roles_(InitialRoles(options_.team)),
      leases_(options_.team.radio().quiet_while_driving()) {}

void FailoverActor::OnStart(Context& context) {
  context.WatchPeers();
  context.Monitor({options_.self, actor_name::kLease});
  context.Watch(Topic::kRoles);
  context.Watch(Topic::kLeases);
}

void FailoverActor::OnMessage(Context& context, const proto::Message& message) {
  if (context.sender().agent != options_.self) {
    if (message.has_leader_check()) OnLeaderCheck(context, message.leader_check());
    return;
  }
  switch (message.body_case()) {
    case proto::Message::kTimer:
      OnTimer(context, message.timer());
      break;
    case proto::Message::kPeerEvent:
      OnPeerEvent(message.peer_event());
      break;
    case proto::Message::kRolesChanged:
      OnRoles(context, message.roles_changed().roles());
      break;
    case proto::Message::kLeasesChanged:
      leases_.SetAll(message.leases_changed());
      break;
    case proto::Message::kDown:
      known_ = connected_;  // LeaseActor lost all leases at its restart; only connected agents announce leases again.
      break;
    case proto::Message::kControlReply:
      if (const auto taken = CheckControlReply(message); !taken && message.request_id() == kTakeLead) {
        spdlog::warn("{}: could not take the lead: {}", ToString(context.self()), ToString(taken.error()));
      }
      return;
    default:
      return;
  }
  Review(context);
}

void FailoverActor::OnRoles(Context& context, const proto::RoleAssignment& roles) {
  // RoleActor may publish one term twice: first without this agent's own role, and again with that role once the
  // assignment is stored.
  const bool is_known = roles.leader() == roles_.leader() && roles.survivor() == roles_.survivor() &&
                        OrderOf(roles.term()) == OrderOf(roles_.term());
  if (is_known || IsNewer(roles_.term(), roles.term())) return;
  StopCounting(context);  // The leader may have changed.
  roles_ = roles;
}

void FailoverActor::OnPeerEvent(const proto::PeerEvent& event) {
  if (event.is_connected()) {
    connected_.insert(event.peer());
    known_.insert(event.peer());
  } else {
    connected_.erase(event.peer());
  }
}

void FailoverActor::OnTimer(Context& context, const proto::Timer& timer) {
  if (timer.kind() == kCheck) {
    check_timer_ = 0;
    if (!MayAskLeader(context)) return;
    proto::Message question;
    question.set_ms_type(proto::CONTROL);
    question.mutable_leader_check();
    (void)context.Send({roles_.leader(), actor_name::kFailover}, std::move(question));
    return;
  }
  if (timer.value() != count_) return;
  timer_ = 0;
  if (IsLeaderMissed(context)) TakeLead(context);
}

// Replies only to the designated survivor; no other agent uses the reply.
void FailoverActor::OnLeaderCheck(Context& context, const proto::LeaderCheck& check) {
  if (!IsAutomatic() || check.is_reply() || context.sender().agent != roles_.survivor()) return;
  proto::Message answer;
  answer.set_ms_type(proto::CONTROL);
  answer.mutable_leader_check()->set_is_reply(true);
  (void)context.Reply(std::move(answer));
}

void FailoverActor::TakeLead(Context& context) {
  const std::string leader = FindAgent(options_.team, roles_.leader())->name();
  proto::Message message;
  message.set_ms_type(proto::CONTROL);
  message.set_request_id(kTakeLead);
  proto::RoleSetRequest& request = *message.mutable_role_set_request();
  request.set_leader(options_.self);
  request.set_survivor(NextSurvivor());
  *request.mutable_expected() = roles_;
  request.set_reason("failover: " + leader + " was silent for " +
                     std::to_string(std::chrono::duration_cast<std::chrono::seconds>(leader_timeout_).count()) + " s");
  spdlog::warn("{}: takes the lead, {}", ToString(context.self()), request.reason());
  (void)context.Send({options_.self, actor_name::kRole}, std::move(message));
}

bool FailoverActor::MayAskLeader(const Context& context) const {
  return IsAutomatic() && roles_.survivor() == options_.self && connected_.contains(roles_.leader()) &&
         !leases_.MayBeSilent(options_.self, context.now()) && !leases_.MayBeSilent(roles_.leader(), context.now());
}

bool FailoverActor::IsLeaderMissed(Context& context) const {
  const bool was_there = known_.contains(roles_.leader()) || HasLeft(options_.team, roles_.leader());
  return IsAutomatic() && roles_.survivor() == options_.self && was_there && !connected_.contains(roles_.leader()) &&
         !leases_.MayBeSilent(options_.self, context.now()) && !leases_.MayBeSilent(roles_.leader(), context.now()) &&
         ReachesAnyOther();
}

bool FailoverActor::ReachesAnyOther() const {
  const auto& agents = options_.team.agents();
  const bool has_others = std::any_of(agents.begin(), agents.end(), [this](const proto::AgentConfig& agent) {
    return !agent.left() && agent.id() != options_.self && agent.id() != roles_.leader();
  });
  return !connected_.empty() || !has_others;
}

AgentId FailoverActor::NextSurvivor() const {
  const auto rank = [this](AgentId agent) { return connected_.contains(agent) ? 0 : agent != roles_.leader() ? 1 : 2; };
  AgentId next = 0;
  for (const proto::AgentConfig& agent : options_.team.agents()) {
    if (agent.id() == options_.self || agent.kind() != proto::AGENT_KIND_ROVER || agent.left()) continue;
    if (next == 0 || rank(agent.id()) < rank(next)) next = agent.id();
  }
  return next;
}

void FailoverActor::Review(Context& context) {
  if (check_timer_ == 0 && MayAskLeader(context)) {
    check_timer_ = context.AfterTimer(leader_timeout_ / kChecksInTimeout, kCheck);
  }
  if (!IsLeaderMissed(context)) return StopCounting(context);
  if (timer_ == 0) timer_ = context.AfterTimer(leader_timeout_, kMissed, ++count_);
}

void FailoverActor::StopCounting(Context& context) {
  ++count_;
  if (timer_ != 0) context.Cancel(std::exchange(timer_, 0));
}

}  // namespace moondb
