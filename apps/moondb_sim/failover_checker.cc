#include "apps/moondb_sim/failover_checker.h"

#include <algorithm>

#include "model/term.h"
#include "runtime/team/team_config.h"

namespace moondb::simulation {
namespace {

// Tolerance for durations, which are sent as seconds in floating point.
constexpr Duration kFailoverRounding = std::chrono::milliseconds(1);
// After leader_timeout_s, the survivor must request the lead within this time. Its actors need the time to notify each
// other.
constexpr Duration kOverdue = std::chrono::seconds(15);

}  // namespace

FailoverChecker::FailoverChecker(AgentId self, const proto::TeamConfig& team, MonotonicTime now)
    : self_(self),
      team_(team),
      timeout_(std::chrono::duration_cast<Duration>(std::chrono::duration<double>(team.roles().leader_timeout_s()))),
      roles_(InitialRoles(team)),
      roles_since_(now),
      reached_since_(now),
      asked_(now),
      verdict_("it did not wait") {}

std::optional<std::string> FailoverChecker::OnHandle(const std::string& actor, const proto::Message& message,
                                                     const LeaseChecker& leases, MonotonicTime now) {
  if (message.hop_sender() != self_ && message.hop_sender() != 0) heard_[message.hop_sender()] = now;
  if (actor == actor_name::kFailover) OnOwn(message, leases, now);
  if (!IsFailover(actor, message)) return std::nullopt;
  asked_ = now;
  return verdict_;
}

bool FailoverChecker::IsFailover(const std::string& actor, const proto::Message& message) {
  return actor == actor_name::kRole && message.role_set_request().reason().starts_with("failover:");
}

void FailoverChecker::OnOwn(const proto::Message& message, const LeaseChecker& leases, MonotonicTime now) {
  switch (message.body_case()) {
    case proto::Message::kTimer:
      verdict_ = WhyNot(leases, now, timeout_ - kFailoverRounding);
      return;
    case proto::Message::kRolesChanged:
      return SetRoles(message.roles_changed().roles(), now);
    case proto::Message::kPeerEvent:
      return SetConnected(message.peer_event(), now);
    case proto::Message::kDown:
      // LeaseActor lost all leases at its restart, and only connected agents announce their leases again. Forget the
      // agents that are not connected.
      lost_.clear();
      return;
    default:
      return;
  }
}

void FailoverChecker::OnFailure(const std::string& actor, MonotonicTime now) {
  if (actor != actor_name::kFailover) return;
  roles_ = InitialRoles(team_);
  roles_since_ = now;
  connected_.clear();
  lost_.clear();
  reached_since_ = now;
  asked_ = now;
}

void FailoverChecker::SetRoles(const proto::RoleAssignment& roles, MonotonicTime now) {
  const bool is_known = roles.leader() == roles_.leader() && roles.survivor() == roles_.survivor() &&
                        OrderOf(roles.term()) == OrderOf(roles_.term());
  if (is_known || IsNewer(roles_.term(), roles.term())) return;
  roles_ = roles;
  roles_since_ = now;
}

void FailoverChecker::SetConnected(const proto::PeerEvent& event, MonotonicTime now) {
  if (event.is_connected()) {
    if (connected_.empty()) reached_since_ = now;
    connected_.insert(event.peer());
    lost_.erase(event.peer());
  } else if (connected_.erase(event.peer()) > 0) {
    lost_[event.peer()] = now;
  }
}

std::optional<std::string> FailoverChecker::WhyNot(const LeaseChecker& leases, MonotonicTime now,
                                                   Duration missed) const {
  constexpr int kLeaderAndSurvivor = 2;
  const AgentId leader = roles_.leader();
  if (team_.roles().failover() != proto::FAILOVER_AUTOMATIC) return "nobody is to do so by itself";
  if (roles_.survivor() != self_) return "it is not the survivor";
  if (connected_.contains(leader)) return "the leader is connected";
  const auto lost = lost_.find(leader);
  if (lost == lost_.end()) return "the leader was never connected";
  if (connected_.empty() && team_.agents_size() > kLeaderAndSurvivor) return "it reaches nobody";
  const auto heard = heard_.find(leader);
  const auto is_short = [&](MonotonicTime since) { return since > now - missed; };
  if (is_short(lost->second)) return "the leader was connected a moment ago";
  if (heard != heard_.end() && is_short(heard->second)) return "the leader was heard a moment ago";
  if (is_short(roles_since_)) return "the roles are new";
  if (is_short(reached_since_)) return "it reached nobody a moment ago";
  if (is_short(leases.LastQuiet(leader, now))) return "the leader drives or sleeps, or did a moment ago";
  if (is_short(leases.LastQuiet(self_, now))) return "it drives or sleeps itself, or did a moment ago";
  return std::nullopt;
}

std::optional<std::string> FailoverChecker::WhyOverdue(const LeaseChecker& leases, MonotonicTime now) const {
  const Duration overdue = timeout_ + kOverdue;
  if (asked_ > now - overdue || WhyNot(leases, now, overdue)) return std::nullopt;
  return "it misses leader " + std::to_string(roles_.leader()) + ", and does not take the lead";
}

}  // namespace moondb::simulation
