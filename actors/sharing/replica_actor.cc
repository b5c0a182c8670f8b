#include "actors/sharing/replica_actor.h"

#include <algorithm>

#include "model/term.h"

namespace moondb {
namespace {

// An agent that is not through by then lets the others go first; it goes on nevertheless.
constexpr Duration kStep = std::chrono::minutes(1);

}  // namespace

Result<int> ReplicaActor::Share(Context& context, const proto::ShareRequest& request) {
  if (!request.from_agents().empty()) {
    return Fail(ErrorCode::kInvalid, "is for sync; replication goes from the leader to the survivor", "from_agents");
  }
  if (request.destination() == self()) return Fail(ErrorCode::kInvalid, "is this agent itself", "destination");
  if (request.destination() != 0) {
    Open(context, request.destination(), proto::RecordFilter(),
         /*is_by_role=*/!is_from_here(context) && request.destination() == roles().leader());
    return 1;
  }
  if (!is_leading()) {
    const std::string leader = roles().leader() == 0 ? "nobody" : NameOf(roles().leader());
    return Fail(ErrorCode::kRefused, NameOf(self()) + " does not lead, " + leader + " does: give the command there");
  }
  if (roles().survivor() == 0) return Fail(ErrorCode::kRefused, "no designated survivor is assigned");
  Open(context, roles().survivor(), proto::RecordFilter(), /*is_by_role=*/true);
  return 1;
}

void ReplicaActor::OnNewRoles(Context& context, const proto::RoleAssignment& previous) {
  if (OrderOf(roles().term()) == OrderOf(previous.term())) return;
  BeginGathering(context);
  if (roles().leader() == previous.leader() && roles().survivor() == previous.survivor()) return;
  const bool was_open = CloseByRole(context);
  if (was_open && is_leading() && roles().survivor() != 0) {
    Open(context, roles().survivor(), proto::RecordFilter(), /*is_by_role=*/true);
  }
}

// --- What a leader gathers ---

void ReplicaActor::BeginGathering(Context& context) {
  CancelOrders(context);
  if (step_timer_ != 0) context.Cancel(std::exchange(step_timer_, 0));
  to_ask_.clear();
  if (!is_leading()) return;
  for (const proto::AgentConfig& agent : team().agents()) {
    if (agent.id() == self()) continue;
    if (agent.id() == roles().survivor()) {
      to_ask_.push_front(agent.id());
    } else {
      to_ask_.push_back(agent.id());
    }
  }
  AskNext(context);
}

void ReplicaActor::AskNext(Context& context) {
  if (step_timer_ != 0) context.Cancel(std::exchange(step_timer_, 0));
  if (to_ask_.empty()) return;
  OrderFrom(context, to_ask_.front());
  step_timer_ = StartStepTimer(context, kStep);
}

void ReplicaActor::OnReceivedAll(Context& context, AgentId sender) {
  const auto asked = std::find(to_ask_.begin(), to_ask_.end(), sender);
  if (asked == to_ask_.end()) return;
  const bool is_turn = asked == to_ask_.begin();
  to_ask_.erase(asked);
  if (is_turn) AskNext(context);
}

void ReplicaActor::OnStepTimer(Context& context) {
  step_timer_ = 0;
  to_ask_.push_back(to_ask_.front());
  to_ask_.pop_front();
  AskNext(context);
}

void ReplicaActor::OnPeerConnected(Context& context, AgentId peer) {
  const auto asked = std::find(to_ask_.begin(), to_ask_.end(), peer);
  if (asked == to_ask_.end() || asked == to_ask_.begin()) return;
  to_ask_.erase(asked);
  to_ask_.push_front(peer);
  AskNext(context);
}

}  // namespace moondb
