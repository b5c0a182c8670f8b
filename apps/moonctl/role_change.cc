#include "apps/moonctl/role_change.h"

#include <algorithm>
#include <set>
#include <thread>

#include "model/command_from.h"
#include "model/term.h"

namespace moondb {
namespace {

constexpr std::chrono::seconds kLimit(10);
constexpr std::chrono::milliseconds kRolePollPeriod(20);
constexpr std::chrono::milliseconds kRelayedRolePollPeriod(500);  // Over the radio.
constexpr std::chrono::milliseconds kTryAgainAfter(200);
constexpr char kExpected[] = "expected";  // Field of the refusal.

}  // namespace

RoleChange::RoleChange(CommandContext& context, proto::RoleAssignment standing)
    : context_(context),
      standing_(std::move(standing)),
      end_(Clock::now() + (context.has_timeout() ? context.WaitTimeout() : kLimit)) {}

Result<RoleChange::Done> RoleChange::Make(proto::RoleSetRequest request, bool is_waiting) {
  *request.mutable_expected()->mutable_term() = standing_.term();
  request.mutable_expected()->set_leader(standing_.leader());
  request.mutable_expected()->set_survivor(standing_.survivor());
  leader_ = request.is_swap() ? standing_.survivor() : request.leader() != 0 ? request.leader() : standing_.leader();
  survivor_ = request.is_swap()         ? standing_.leader()
              : request.survivor() != 0 ? request.survivor()
                                        : standing_.survivor();
  auto target = ChooseTarget(request);
  if (!target) return tl::unexpected(target.error());
  auto shown = Give(*target->client, request);
  if (!shown) return tl::unexpected(shown.error());
  if (request.is_dry_run() || !is_waiting) return Done{*std::move(shown), {}};
  return UntilConfirmed(*target->client, *std::move(shown));
}

// -a; else the first that answers of: those that may change the roles, the others. Of each the agent that is to lead
// comes first, then the leader and the survivor.
Result<AgentClient> RoleChange::ChooseTarget(const proto::RoleSetRequest& request) {
  if (!context_.agent.empty()) return context_.Connect(context_.agent);
  const proto::TeamConfig& team = (*context_.Team())->config;
  std::vector<AgentId> agents{static_cast<AgentId>(request.leader()), static_cast<AgentId>(standing_.leader()),
                              static_cast<AgentId>(standing_.survivor())};
  for (const proto::AgentConfig& agent : team.agents()) agents.push_back(agent.id());
  std::stable_partition(agents.begin(), agents.end(), [&](AgentId agent) {
    return agent == standing_.leader() || agent == standing_.survivor() || MayCommand(team, agent);
  });
  std::set<AgentId> asked{0};
  for (const AgentId agent : agents) {
    if (!asked.insert(agent).second) continue;
    if (auto connected = context_.Connect(AgentName(team, agent))) return connected;
  }
  return Fail(ErrorCode::kUnavailable, "no agent of team " + team.team() + " answers");
}

Result<proto::RoleShowReply> RoleChange::Give(Client& target, const proto::RoleSetRequest& request) {
  bool is_unanswered = false;
  while (true) {
    auto shown = target.SetRoles(request);
    if (shown) return shown;
    const Error& error = shown.error();
    if (error.field == kExpected) {
      auto held = target.Roles();
      if (held && is_unanswered && IsWanted(held->roles()) && IsNewer(held->roles().term(), standing_.term())) {
        return held;  // The request whose answer did not come did it.
      }
      // An agent that has yet to hear of the present roles hears of them in a moment.
      const bool is_behind = held && IsNewer(standing_.term(), held->roles().term());
      if (!is_behind || IsOver()) return Fail(error.code, error.text);
    } else if (error.code == ErrorCode::kTimedOut || error.code == ErrorCode::kUnavailable) {
      is_unanswered = true;
      if (IsOver()) {
        return Fail(error.code, error.text + "; whether the roles have changed is not known: see moonctl role show");
      }
    } else {
      return shown;
    }
    std::this_thread::sleep_for(kTryAgainAfter);
  }
}

Result<RoleChange::Done> RoleChange::UntilConfirmed(Client& target, proto::RoleShowReply shown) {
  const proto::TeamConfig& team = (*context_.Team())->config;
  while (true) {
    const std::vector<AgentId> not_confirmed = NotConfirmed(shown);
    if (not_confirmed.empty() || IsOver()) {
      Done done{std::move(shown), {}};
      for (const AgentId agent : not_confirmed) done.not_confirmed.push_back(AgentName(team, agent));
      return done;
    }
    std::this_thread::sleep_for(context_.is_relayed() ? kRelayedRolePollPeriod : kRolePollPeriod);
    auto held = target.Roles();
    if (!held || IsNewer(shown.roles().term(), held->roles().term())) continue;
    if (!IsWanted(held->roles())) {
      return Fail(ErrorCode::kRefused, "another change came after this one: leader " +
                                           AgentName(team, held->roles().leader()) + ", survivor " +
                                           AgentName(team, held->roles().survivor()));
    }
    shown = *std::move(held);
  }
}

// A leader acts in terms of its own alone: one that another agent issued it has not begun to act on.
std::vector<AgentId> RoleChange::NotConfirmed(const proto::RoleShowReply& shown) const {
  std::vector<AgentId> missing;
  const auto& confirmed = shown.confirmed_by();
  const auto is_confirmed = [&](AgentId agent) {
    return std::find(confirmed.begin(), confirmed.end(), agent) != confirmed.end();
  };
  if (shown.roles().term().issuer() != leader_ || !is_confirmed(leader_)) missing.push_back(leader_);
  if (survivor_ != 0 && !is_confirmed(survivor_)) missing.push_back(survivor_);
  return missing;
}

bool RoleChange::IsWanted(const proto::RoleAssignment& roles) const {
  return roles.leader() == leader_ && roles.survivor() == survivor_;
}

}  // namespace moondb
